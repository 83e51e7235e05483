/* pinwheel sensitivity: derivatives of outputs of a run with respect to parameters and initial values. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "figure.h"
#include "report.h"
#include "sensitivity.h"

static int sensitivity_settings (pw_sensitivity *x, pw_error *error) {
  pw_run_defaults d = pw_cli_defaults (pw_file_table (x->m.file));
  pw_specialise when;
  x->method = x->line.method ? x->line.method : d.method;
  int status = pw_cli_settings (&x->line, &d, &x->t_end, &x->settings, &x->limit, error);
  if (status == PW_OK) status = pw_cli_specialise (x->line.specialise, &when, error);
  if (status != PW_OK) return status;
  pw_cli_engine_open (&x->engine, x->m.system, when, pw_method_steps (x->method, &x->settings, d.step, x->t_end));
  x->settings.specialised = pw_cli_engine_code (&x->engine);
  return PW_OK;
}

/* Finds the unknowns with a run of their own, which has their values. */
static int sensitivity_unknowns (pw_sensitivity *x, pw_error *error) {
  int count = 0;
  while (x->by && x->by[count]) count++;
  if (count == 0) return pw_fail (error, PW_INPUT, "--by is missing: expected a parameter or an initial value");
  if (x->of == NULL) return pw_fail (error, PW_INPUT, "--of is missing: expected an output, such as frame.x");
  int status = pw_sensitivity_open (x, count, x->folder != NULL, error);
  if (status == PW_OK) status = pw_cli_number ("--every", x->every, PW_POSITIVE, &x->dt, error);
  if (status != PW_OK) return status;
  pw_run *r = pw_run_open (x->m.system, x->method, &x->settings, error);
  status = r ? PW_OK : error->status;
  for (int i = 0; i < count && status == PW_OK; i++) {
    status = pw_unknown_find (&x->unknown[i], &x->m, r, x->by[i], error);
    for (int k = 0; k < i && status == PW_OK; k++)
      if (strcmp (x->by[k], x->by[i]) == 0) status = pw_fail (error, PW_INPUT, "--by %s is given twice", x->by[i]);
  }
  if (r) pw_run_close (r);
  return status;
}

static int sensitivity_compute (pw_sensitivity *x, pw_error *error) {
  pw_progress progress;
  double begun = pw_cpu_clock ();
  pw_stop_catch ();
  pw_progress_start (&progress, pw_file_name (x->m.file), x->t_end, 1);
  int status = pw_sensitivity_compute (x, &progress, error);
  pw_progress_end (&progress);
  pw_stop_release ();
  x->cpu = pw_cpu_clock () - begun;
  return status;
}

static int sensitivity_command (void *options, pw_error *error) {
  pw_sensitivity *x = options;
  int lock = -1, status = pw_cli_open (&x->m, &x->line, error);
  if (status == PW_OK) status = sensitivity_settings (x, error);
  if (status == PW_OK) status = sensitivity_unknowns (x, error);
  if (status == PW_OK) status = pw_figure_results (&x->line, &x->m, x->folder, "sensitivity", &lock, error);
  if (status == PW_OK) pw_report_model (x->m.model);
  if (status == PW_OK) status = sensitivity_compute (x, error);
  if (status == PW_OK) pw_sensitivity_print (x);
  if (status == PW_OK && x->folder) status = pw_sensitivity_write (x, error);
  int stopped = status == PW_OK && x->stopped;
  if (stopped) status = pw_limit_fail (&x->limit, pw_run_time (x->base.run), error);
  if (lock >= 0) close (lock);
  pw_sensitivity_close (x);
  pw_cli_engine_close (&x->engine);
  pw_cli_close_model (&x->m);
  if (status == PW_RETRY) pw_cli_say ("pinwheel: interrupted; results are incomplete\n");
  return status == PW_RETRY ? PW_INTERRUPTED : status;
}

static const struct poptOption sensitivity_options[] = {
  PW_OPTION_GROUP ("Sensitivity"),
  PW_LIST_OPTION (pw_sensitivity, of, "of", 0, "OUTPUT",
                  "A column of the table of `run` at the end, or its max:, min:, mean:, integral: or rms:, such as "
                  "max:B.Fx; or an expression of these; repeatable"),
  PW_LIST_OPTION (pw_sensitivity, by, "by", 0, "NAME",
                  "A parameter, or the initial value of a state, such as body.vx; repeatable"),
  PW_TEXT_OPTION (pw_sensitivity, every, "every", 0, "DT",
                  "Time between rows of the table [s] (default a thousandth of the final time)"),
  PW_TEXT_OPTION (pw_sensitivity, folder, "output", 'o', "DIR",
                  "Write sensitivity.csv (outputs and derivatives along the run), sensitivity.json and a figure into a "
                  "folder"),
  PW_WIDTH_OPTION,
  PW_METHOD_OPTIONS,
  PW_MODEL_OPTIONS,
  POPT_TABLEEND
};

const pw_command pw_cli_sensitivity = {
  .name = "sensitivity",
  .synopsis = "MODEL --of OUTPUT --by NAME [OPTION...]",
  .summary = "differentiate outputs of a run with respect to parameters and initial values",
  .help = "Differentiate outputs of a run with respect to parameters and initial values, at the end and along the run, "
          "by the variational equations: exact in the states, by differences of compiled models in the parameters, "
          "with the error of these.",
  .least = 1,
  .most = 1,
  .size = sizeof (pw_sensitivity),
  .function = sensitivity_command,
  .options = sensitivity_options,
};
