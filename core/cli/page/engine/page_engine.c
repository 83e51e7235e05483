/* The engine of interactive pages: models, methods and samples for figures, compiled to WebAssembly.  Its exported
 * functions are called by page.js.  Files are in memory; there is one model at a time. */
#include <amd.h>
#include <btf.h>
#include <complex.h>
#include <errno.h>
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>
#include "plot.h"
#include "yaml.h"
#include "pinwheel-method.h"
#include "sparse.h"

#define PAGE_EXPORT(name) __attribute__ ((export_name (#name)))

/* The clock of the browser [ms]; page.js provides it. */
__attribute__ ((import_module ("page"), import_name ("now"))) double pw_page_now (void);

static pw_page_file *page_file;
static int page_files;
static size_t page_room; /* entries of page_file that are allocated */

PAGE_EXPORT (allocate) void *page_allocate (size_t size) {
  return calloc (1, size);
}

/* Adds a file, whose name and bytes belong to the engine from now on. */
PAGE_EXPORT (file) void page_add_file (char *name, char *bytes, size_t size) {
  if (pw_grow (&page_file, (size_t)page_files, &page_room, sizeof *page_file) != PW_OK) return; /* not found later */
  page_file[page_files++] = (pw_page_file){ name, bytes, size };
}

/* The index of a file, given its name or "/" and its name; the number of files if there is none. */
static int page_find_file (const char *name) {
  int i = 0;
  name += *name == '/';
  while (i < page_files && strcmp (page_file[i].name, name) != 0) i++;
  return i;
}

/* The next four functions replace those of file.c, libc and yaml_tree.c, which the engine does not contain. */

FILE *pw_open_input (const char *path, const char **why) {
  int i = page_find_file (path);
  *why = i < page_files ? "out of memory" : "it is not part of this page";
  errno = i < page_files ? ENOMEM : ENOENT;
  return i < page_files ? fmemopen (page_file[i].bytes, page_file[i].size, "r") : NULL;
}

int pw_open_input_status (void) {
  return errno == ENOMEM ? PW_RESOURCE : PW_INPUT;
}

char *realpath (const char *path, char *resolved) {
  return strcpy (resolved, path);
}

int pw_yaml_read_tree (pw_yaml *y, pw_error *error) {
  int i = page_find_file ("tree");
  if (i == page_files) return pw_fail (error, PW_RESOURCE, "out of memory"); /* it could not be added */
  return pw_yaml_load_tree (y, page_file[i].bytes, page_file[i].size, error);
}

extern const pw_plugin_table pw_plugin __attribute__ ((weak)); /* of a model in C */

static pw_error page_error;
static const pw_plugin_table *page_table;
static const char *page_name;

PAGE_EXPORT (error) const char *page_error_text (void) {
  return page_error.text;
}

/* Opens the model of this name; 0 if that succeeds. */
PAGE_EXPORT (open) int page_open (const char *name) {
  page_name = name;
  page_table = &pw_plugin;
  if (page_table == NULL) {
    pw_yaml *y = pw_yaml_open ("/model", name, PW_FILE_DEFAULT_BYTES, &page_error);
    page_table = y ? &y->table : NULL;
  }
  return page_error.status;
}

static pw_model *page_model;
static pw_system *page_system;
static pw_plots *page_plots;
static pw_statistics page_statistics;
static double page_energy_defect; /* relative */
static double page_deadline;      /* [ms] */

static int page_is_late (void *context) {
  (void)context;
  return pw_page_now () > page_deadline;
}

/* Compiles the model with these values of the parameters, in the order of the table. */
static int page_compile (const double *parameter) {
  pw_plots_close (page_plots);
  pw_system_free (page_system);
  pw_model_free (page_model);
  page_plots = NULL, page_system = NULL, page_error = (pw_error){ 0 };
  page_model = pw_model_new (page_name, page_table, &page_error);
  for (int i = 0; page_model && page_table->parameters && page_table->parameters[i].name; i++)
    pw_model_set (page_model, page_table->parameters[i].name, parameter[i], &page_error);
  if (page_error.status == PW_OK) pw_model_build (page_model, &page_error);
  if (page_error.status == PW_OK) page_system = pw_system_compile (page_model, &page_error);
  return page_error.status;
}

static int page_take_samples (pw_run *r) {
  int status = PW_OK;
  pw_sample sample;
  while (status == PW_OK && page_plots && pw_plots_next (page_plots) <= pw_run_time (r)) {
    status = pw_run_sample (r, pw_plots_next (page_plots), &sample, &page_error);
    if (status == PW_OK) pw_plots_add (page_plots, &sample);
    page_energy_defect = status == PW_OK ? pw_run_energy_defect (r, &sample) : NAN;
  }
  return status;
}

static int page_integrate (pw_run *r, double t_end) {
  int status = page_take_samples (r);
  while (status == PW_OK && pw_run_time (r) < t_end) {
    status = pw_run_advance (r, t_end, &page_error);
    if (status == PW_OK) status = page_take_samples (r);
  }
  page_statistics = *pw_run_statistics (r);
  return status;
}

/* Opens a run of the model with the parameters and initial values given, for at most `limit` ms of computing time. */
static pw_run *page_run_open (const char *method, double limit, pw_settings settings, int forces,
                              const double *parameter) {
  if (page_compile (parameter) != PW_OK) return NULL;
  page_deadline = pw_page_now () + limit;
  settings.stop = page_is_late;
  if (settings.ledger) page_plots = pw_plots_open (NULL, forces, page_model, page_system, settings.span, &page_error);
  return page_error.status == PW_OK ? pw_run_open (page_system, method, &settings, &page_error) : NULL;
}

/* Integrates.  0, or a negative status with the error set; the samples so far are kept.  With keep_samples 0 it only
 * integrates, to be timed. */
PAGE_EXPORT (run)
int page_run (const char *method, double step, double rtol, double t_end, double limit, int keep_samples,
              const double *parameter, const pw_initial_value *initial, int initials) {
  const pw_settings settings = {
    .span = t_end, .step = step, .rtol = rtol, .ledger = keep_samples, .initial = initial, .initials = initials
  };
  pw_run *r = page_run_open (method, limit, settings, 1, parameter);
  int status = r ? page_integrate (r, t_end) : page_error.status;
  if (status == PW_STOPPED)
    status = pw_fail (&page_error, PW_METHOD,
                      "stopped at t = %.4g s, after %g s of computation; a larger step or tolerance is faster",
                      pw_run_time (r), limit / 1000);
  if (page_plots) pw_plots_events (page_plots, r);
  pw_run_close (r);
  return status;
}

enum { STAGES = 4 };

/* Adds samples of a step h of rk4 from the state reached: the states of its four stages, then its result. */
static int page_stages (pw_run *r, double h, double *memory) {
  static const double node[STAGES] = { 0, 0.5, 0.5, 1 }, weight[STAGES] = { 1, 2, 2, 1 }; /* Kutta 1901 */
  const pw_reached x = pw_run_state (r);
  const size_t n = (size_t)pw_system_coordinates (x.system);
  double *q = memory, *v = q + n, *a = v + n, *q_end = a + n, *v_end = q_end + n, *lambda = v_end + n;
  memcpy (q_end, x.q, n * sizeof *q);
  memcpy (v_end, x.v, n * sizeof *v);
  for (int i = 0; i < STAGES; i++) {
    for (size_t j = 0; j < n; j++) {
      q[j] = x.q[j] + node[i] * h * v[j]; /* v, a: of the stage before */
      v[j] = x.v[j] + node[i] * h * a[j];
    }
    const double t = pw_stage_time (r, x.t + node[i] * h);
    if (pw_run_accelerate (r, t, q, v, a, lambda) != PW_OK)
      return pw_fail (&page_error, PW_METHOD, "stage %d of the step has no accelerations", i + 1);
    for (size_t j = 0; j < n; j++) q_end[j] += h / 6 * weight[i] * v[j], v_end[j] += h / 6 * weight[i] * a[j];
    pw_plots_add (page_plots, &(pw_sample){ .t = t, .q = q, .v = v });
  }
  pw_plots_add (page_plots, &(pw_sample){ .t = x.t + h, .q = q_end, .v = v_end });
  return PW_OK;
}

/* Runs by rk4+projection until a step of which `t` is a part.  Its samples: four stages, the result before the
 * projection and after it.  As page_run. */
PAGE_EXPORT (step)
int page_step (double step, double t, double limit, const double *parameter, const pw_initial_value *initial,
               int initials) {
  const pw_settings settings = {
    .span = t + 3 * step, .step = step, .ledger = 1, .initial = initial, .initials = initials
  };
  pw_run *r = page_run_open ("rk4+projection", limit, settings, 0, parameter);
  int status = r ? PW_OK : page_error.status;
  double h = step;
  for (; status == PW_OK; status = pw_run_advance (r, settings.span, &page_error)) {
    const pw_reached x = pw_run_state (r);
    h = fmin (step, x.breakpoint > x.t ? x.breakpoint - x.t : step);
    if (x.t + h > t) break;
  }
  double *memory =
      r ? calloc ((size_t)(5 * pw_system_coordinates (page_system) + pw_system_rows (page_system)) + 1, sizeof *memory)
        : NULL;
  if (status == PW_OK)
    status = memory ? page_stages (r, h, memory) : pw_fail (&page_error, PW_RESOURCE, "out of memory");
  if (status == PW_OK) status = pw_run_advance (r, settings.span, &page_error);
  pw_sample sample;
  if (status == PW_OK) status = pw_run_sample (r, pw_run_time (r), &sample, &page_error);
  if (status == PW_OK) pw_plots_add (page_plots, &sample);
  if (status == PW_STOPPED) status = pw_fail (&page_error, PW_METHOD, "the steps before this one take too long");
  free (memory);
  pw_run_close (r);
  return status;
}

/* The samples of the run. */
PAGE_EXPORT (data) const double *page_data (void) {
  return page_plots->data;
}

static void page_write_scene (pw_json *j) {
  const pw_statistics *s = &page_statistics;
  const struct {
    const char *key;
    double value;
  } number[] = { { "samples", page_plots->samples },
                 { "width", page_plots->sample_size },
                 { "steps", (double)s->steps },
                 { "rejected", (double)s->rejected },
                 { "g", s->g },
                 { "jv", s->jv },
                 { "evaluations", (double)s->rhs },
                 { "energy_defect", page_energy_defect } };
  pw_json_open (j, NULL, '{');
  for (size_t i = 0; i < sizeof number / sizeof *number; i++) pw_json_number (j, number[i].key, number[i].value);
  pw_animation_scene (j, page_plots);
  pw_json_close (j, '}');
}

/* Shapes, size of the data and statistics of the run as JSON; free it with page_release.  NULL without a run. */
PAGE_EXPORT (scene) char *page_scene (void) {
  pw_stream scene;
  if (page_plots == NULL) return NULL;
  FILE *f = pw_stream_open (&scene);
  if (f) page_write_scene (&(pw_json){ .f = f });
  pw_stream_close (f, &scene);
  return scene.text;
}

PAGE_EXPORT (release) void page_release (void *p) {
  free (p);
}

/* The functions of libraries that the methods of pages call, for scenes small enough to run in a web page: AMD's
 * order, BTF's matching, LAPACK's solution by a Cholesky factorisation, KLU's factorisation. */

/* Nodes with few neighbours first; where that does not reduce fill-in, block_ldl.c keeps the natural order. */
int amd_order (int n, const int Ap[], const int Ai[], int P[], double control[], double info[]) {
  (void)Ai, (void)control, (void)info;
  for (int degree = 0, k = 0; k < n; degree++)
    for (int i = 0; i < n; i++)
      if (Ap[i + 1] - Ap[i] == degree) P[k++] = i;
  return AMD_OK;
}

/* As if all columns were matched: factorisation reveals dependent equations, too. */
int btf_maxtrans (int nrow, int ncol, int Ap[], int Ai[], double maxwork, double *work, int Match[], int Work[]) {
  (void)nrow, (void)Ap, (void)Ai, (void)maxwork, (void)work, (void)Match, (void)Work;
  return ncol;
}

/* Solves A x = b, A = U^T U, for the layout by columns, the upper triangle (uplo) and one right-hand side (nrhs). */
lapack_int LAPACKE_dposv_work (int layout, char uplo, lapack_int n, lapack_int nrhs, double *a, lapack_int lda,
                               double *b, lapack_int ldb) {
  (void)layout, (void)uplo, (void)nrhs, (void)ldb;
  for (int j = 0; j < n; j++)
    for (int i = 0; i <= j; i++) {
      double sum = a[i + j * lda];
      for (int k = 0; k < i; k++) sum -= a[k + i * lda] * a[k + j * lda];
      if (i == j && !(sum > 0)) return j + 1;
      a[i + j * lda] = i == j ? sqrt (sum) : sum / a[i + i * lda];
    }
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < i; k++) b[i] -= a[k + i * lda] * b[k];
    b[i] /= a[i + i * lda];
  }
  for (int i = n - 1; i >= 0; i--) {
    for (int k = i + 1; k < n; k++) b[i] -= a[i + k * lda] * b[k];
    b[i] /= a[i + i * lda];
  }
  return 0;
}

/* ---- Factorisation of a sparse matrix (sparse.h) as a dense one, by columns, with partial pivoting.  All numbers are
 * complex; their real and imaginary parts are those of `value`, of which real matrices have the real ones only. ---- */

enum { LIBRARIES_MOST = 4000 }; /* rows of a matrix, at most: it takes 16 bytes for each entry */

int pw_sparse_open (pw_sparse *x, pw_sparse_numbers numbers, int n, int64_t *colptr, int64_t *rowind) {
  *x = (pw_sparse){ .numbers = numbers, .colptr = colptr, .rowind = rowind };
  x->symbolic = calloc (1, sizeof *x->symbolic);
  x->factors = n <= LIBRARIES_MOST ? calloc ((size_t)n * (size_t)(n + 1) + 1, sizeof (complex double)) : NULL;
  if (x->symbolic) x->symbolic->n = n;
  return x->symbolic && x->factors ? PW_OK : PW_RESOURCE;
}

void pw_sparse_close (pw_sparse *x) {
  free (x->symbolic);
  free (x->factors);
}

/* Pivots are selected anew in each factorisation. */
void pw_sparse_forget_pivots (pw_sparse *x) {
  (void)x;
}

/* The factors, column by column, and after them the row of each pivot. */
int pw_sparse_factor (pw_sparse *x, double *value) {
  const int n = (int)x->symbolic->n, parts = x->numbers == PW_SPARSE_COMPLEX ? 2 : 1;
  complex double *a = memset (x->factors, 0, (size_t)n * (size_t)(n + 1) * sizeof *a), *row = a + n * n;
  for (int j = 0; j < n; j++)
    for (int64_t p = x->colptr[j]; p < x->colptr[j + 1]; p++)
      a[x->rowind[p] + j * n] = CMPLX (value[parts * p], parts == 2 ? value[2 * p + 1] : 0);
  for (int k = 0; k < n; k++) {
    int best = k;
    for (int i = k + 1; i < n; i++)
      if (cabs (a[i + k * n]) > cabs (a[best + k * n])) best = i;
    if (!(cabs (a[best + k * n]) > 0)) return PW_SINGULAR;
    row[k] = best;
    for (int j = 0; j < n; j++) {
      const complex double swapped = a[best + j * n];
      a[best + j * n] = a[k + j * n], a[k + j * n] = swapped;
    }
    for (int i = k + 1; i < n; i++) a[i + k * n] /= a[k + k * n];
    for (int j = k + 1; j < n; j++)
      for (int i = k + 1; i < n && a[k + j * n] != 0; i++) a[i + j * n] -= a[i + k * n] * a[k + j * n];
  }
  return PW_OK;
}

int pw_sparse_solve (pw_sparse *x, double *right) {
  const int n = (int)x->symbolic->n, parts = x->numbers == PW_SPARSE_COMPLEX ? 2 : 1;
  const complex double *a = (const complex double *)x->factors, *row = a + n * n;
  complex double *b = calloc ((size_t)n + 1, sizeof *b);
  if (b == NULL) return PW_RESOURCE;
  for (int k = 0; k < n; k++) b[k] = CMPLX (right[parts * k], parts == 2 ? right[2 * k + 1] : 0);
  for (int k = 0; k < n; k++) {
    const int best = (int)creal (row[k]);
    const complex double swapped = b[best];
    b[best] = b[k], b[k] = swapped;
    for (int i = 0; i < k; i++) b[k] -= a[k + i * n] * b[i];
  }
  for (int k = n - 1; k >= 0; k--) {
    for (int i = k + 1; i < n; i++) b[k] -= a[k + i * n] * b[i];
    b[k] /= a[k + k * n];
  }
  for (int k = 0; k < n; k++) {
    right[parts * k] = creal (b[k]);
    if (parts == 2) right[2 * k + 1] = cimag (b[k]);
  }
  free (b);
  return PW_OK;
}
