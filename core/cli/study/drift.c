/* pinwheel drift: what a long run does to the constraints and the energy, under each stabilisation side by side, and how
 * that depends on Baumgarte's alpha and beta and on the projection's metric and frequency. */
#include <math.h>
#include <string.h>
#include <unistd.h>
#include "drift.h"
#include "figure.h"
#include "stop.h"
#include "text.h"

/* ---- Before it begins ---- */

/* Every stabilisation of an explicit integrator and of the implicit ones. */
static void drift_usual (char *text, size_t size) {
  static const char *const usual[] = { "rk4", "ida", "galpha" };
  size_t n = 0;
  *text = 0;
  for (size_t k = 0; k < sizeof usual / sizeof *usual; k++)
    for (int i = 0; pw_methods[i]; i++)
      for (const pw_stabilisation *s = pw_methods[i]->stabilisations;
           strcmp (pw_methods[i]->name, usual[k]) == 0 && s->name; s++)
        n += (size_t)snprintf (text + n, size - n, "%s%s+%s", n ? "," : "", pw_methods[i]->name, s->name);
}

static int drift_settle (pw_drift *x, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  char usual[1000];
  if (d.rtol == 0) d.rtol = 1e-6;
  int status = pw_cli_settings (&x->line, &d, &x->t_end, &x->settings, &x->limit, error);
  x->settings.ledger = 1;
  drift_usual (usual, sizeof usual);
  if (status == PW_OK) status = pw_contestants_read (&x->list, x->methods_text ? x->methods_text : usual, error);
  return status == PW_OK ? pw_drift_rows (x, error) : status;
}

static int drift_open (pw_drift *x, pw_error *error) {
  static const char *const names[] = { ".dat", ".gp", ".svg", ".png", "drift.csv", "drift-time.csv", NULL };
  char path[FIGURE_PATH + 16];
  int status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = drift_settle (x, error);
  if (status != PW_OK || x->folder == NULL) return status;
  pw_use use[] = { PW_CLI_MODEL_USE, { "-o", x->folder, PW_WRITES_INTO, names } };
  if (pw_cli_uses (&x->line, x->m.file, use, sizeof use / sizeof *use, error) != PW_OK) return error->status;
  x->lock = pw_figure_folder (x->folder, error);
  if (x->lock < 0) return error->status;
  snprintf (path, sizeof path, "%s/drift.csv", x->folder);
  x->csv = pw_output_open (path, error);
  return x->csv ? pw_drift_csv_head (x, error) : error->status;
}

/* ---- Rows ---- */

static void drift_title (const pw_drift *x) {
  char t[32], h[32], rtol[32];
  printf (
      "%s, %s s, steps of %s s or rtol %s: the worst of all steps, the worst of the last %g %%, and how it grows\n\n",
      pw_file_name (x->m.file), pw_format (t, x->t_end, 6), pw_format (h, x->settings.step, 6),
      pw_format (rtol, x->settings.rtol, 6), 100.0 / DRIFT_PARTS);
}

static int drift_rows (pw_drift *x, pw_error *error) {
  int status = PW_OK;
  drift_title (x);
  pw_progress_count (&x->progress, pw_file_name (x->m.file), "runs", 0, x->rows);
  for (x->done = 0; x->done < x->rows; x->done++) {
    pw_drift_row *r = &x->row[x->done];
    status = pw_drift_run (x, r, error);
    pw_progress_end (&x->progress);
    if (status != PW_OK) return status;
    if (x->done == 0 || r->group != r[-1].group) pw_drift_head (x, r->group, stdout);
    pw_drift_line (x, r, stdout);
    fflush (stdout);
    if (x->csv) status = pw_drift_csv_line (x, r, error);
    if (status != PW_OK) return status;
  }
  return PW_OK;
}

/* ---- After it ---- */

static int drift_interrupted (pw_drift *x) {
  char part[FIGURE_PATH + 16] = "";
  if (x->csv) pw_text_abandon (x->csv, x->done, part, sizeof part);
  pw_cli_say ("pinwheel: interrupted; %d of %d runs are done%s%s\n", x->done, x->rows, *part ? ", and kept in " : "",
              part);
  return PW_INTERRUPTED;
}

/* A whole table loses its ending .part; figures are drawn of it. */
static int drift_finish (pw_drift *x, int status, pw_error *error) {
  if (status == PW_RETRY && pw_stop) return drift_interrupted (x);
  if (x->csv == NULL) return status;
  pw_output *csv = x->csv;
  x->csv = NULL;
  if (status != PW_OK) {
    pw_text_abandon (csv, x->done, (char[FIGURE_PATH + 16]){ 0 }, FIGURE_PATH + 16);
    return status;
  }
  status = pw_output_finish (csv, error);
  if (status == PW_OK) status = pw_drift_csv_time (x, error);
  return status == PW_OK ? pw_drift_plot (x, error) : status;
}

/* If no run has reached the end, that is a failure. */
static int drift_verdict (const pw_drift *x, pw_error *error) {
  for (int i = 0; i < x->rows; i++)
    if (x->row[i].status == PW_OK) return PW_OK;
  return pw_fail (error, PW_METHOD, "no method has reached the end; the last of them: %s", x->row[x->rows - 1].reason);
}

static int drift_command (void *options, pw_error *error) {
  pw_drift *x = options;
  x->lock = -1;
  int status = drift_open (x, error);
  if (status == PW_OK) {
    pw_stop_catch ();
    status = drift_rows (x, error);
    pw_stop_release ();
  }
  status = drift_finish (x, status, error);
  if (status == PW_OK) status = drift_verdict (x, error);
  if (x->lock >= 0) close (x->lock);
  pw_drift_free_rows (x);
  pw_contestants_close (&x->list);
  pw_cli_close_model (&x->m);
  return status == PW_INTERRUPTED ? status : error->status;
}

static const struct poptOption drift_options[] = {
  PW_OPTION_GROUP ("Comparison"),
  PW_TEXT_OPTION (
      pw_drift, methods_text, "methods", 'm', "A,B,...|all",
      "Methods, separated by commas; all: every integrator with every stabilisation (default: those of rk4, "
      "ida and galpha)"),
  PW_STEP_OPTIONS,
  PW_LIST_OPTION (
      pw_drift, vary, "vary", 'v', "OPTION=RANGE",
      "Values of an option: alpha or beta [1/s] of baumgarte, every [steps] of projection; repeatable. RANGE: "
      "V1,V2,..., lin:FIRST:LAST:COUNT or log:FIRST:LAST:COUNT"),
  PW_FLAG_OPTION (pw_drift, only_methods, "only-methods", "Omit the dependence of drift on options"),
  PW_TEXT_OPTION (pw_drift, folder, "output", 'o', "DIR", "Write tables and figures into a folder"),
  PW_MODEL_OPTIONS,
  POPT_TABLEEND,
};

const pw_command pw_cli_drift = {
  .name = "drift",
  .synopsis = "MODEL [OPTION...]",
  .summary = "compare the drift of constraints and energy in long runs, by stabilisation",
  .help =
      "Compare how constraint residuals and the energy defect grow during a long run, by method and stabilisation, and "
      "how they depend on the parameters of Baumgarte stabilisation and projection.",
  .least = 1,
  .most = 1,
  .size = sizeof (pw_drift),
  .function = drift_command,
  .options = drift_options,
};
