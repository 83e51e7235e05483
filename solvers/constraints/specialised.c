/* Use of specialised code, compiled for one scene, in place of the general evaluation and projection.  It refuses
 * states at which a pivot is small or a value extreme; the general functions evaluate these. */
#include <math.h>
#include "method.h"
#include "specialised.h"
#include "util.h"

/* pw_scene.update: evaluates the signals for the compiled code. */
static int specialised_update (void *workspace, double t, const double *q, const double *v) {
  return pw_update_signals (workspace, t, q, v);
}

/* Makes r->scene, the data of the compiled code; PW_OK or PW_RESOURCE. */
static int specialised_allocate (pw_run *r, int constants) {
  const pw_system *s = r->s;
  const void **element = pw_arena_alloc (&r->arena, (size_t)s->batches * sizeof *element);
  const pw_kind **kind = pw_arena_alloc (&r->arena, (size_t)s->batches * sizeof *kind);
  const pw_signal **signal = pw_arena_alloc (&r->arena, (size_t)s->sources * sizeof *signal);
  double *constant = pw_arena_alloc (&r->arena, (size_t)constants * sizeof *constant); /* filled by `prepare` */
  r->scene = pw_arena_alloc (&r->arena, sizeof *r->scene);
  if (!element || !kind || !signal || !constant || !r->scene) return PW_RESOURCE;
  for (int i = 0; i < s->batches; i++) element[i] = s->batch[i].b.element, kind[i] = s->batch[i].kind;
  for (int i = 0; i < s->sources; i++) signal[i] = &r->w->source[i].signal;
  *r->scene = (pw_scene){ .element = element,
                          .kind = kind,
                          .signal = signal,
                          .constant = constant,
                          .mass = s->mass,
                          .force = s->constant,
                          .u = r->w->u,
                          .t_signal = &r->w->t_signal,
                          .update = specialised_update,
                          .workspace = r->w };
  return PW_OK;
}

int pw_specialised_open (pw_run *r, pw_error *error) {
  const pw_specialised *code = r->settings.specialised;
  if (code == NULL || r->settings.integrals > 0) return PW_OK;
  if (!pw_specialised_fits (code, r->s))
    return pw_fail (error, PW_INPUT, "model %s: the specialised code belongs to another scene", r->s->model);
  if (specialised_allocate (r, code->constants) != PW_OK) return pw_fail_memory (r->s, error);
  r->scene->length = r->w->scale.length, r->scene->speed = r->scene->length / r->w->scale.time;
  r->scene->redundant_residual = r->thresholds.redundant_residual;
  r->scene->alpha = r->alpha, r->scene->beta = r->beta;
  if (code->prepare (r->scene) != 0) r->scene = NULL;
  pw_specialised_select (r);
  return PW_OK;
}

void pw_specialised_select (pw_run *r) {
  const pw_specialised *code = r->settings.specialised;
  int suits = r->scene != NULL;
  for (int i = 0; suits && i < r->s->rows; i++) suits = code->independent[i] == (r->active == NULL || r->active[i]);
  r->specialised = suits ? code : NULL;
}

/* 0 also where a singular configuration may be ahead and steps are fixed: the general functions then compute the sine
 * of every stage.  Adaptive methods need it only below the pivots that the specialised code accepts. */
int pw_specialised_suits (const pw_run *r) {
  const pw_watchdog *watch = &r->watchdog;
  return r->specialised && !r->redundant_drive && !(watch->singular_ahead && watch->saddle && r->fixed_steps) &&
         !r->near_singular && !r->w->hold;
}

void pw_specialised_count (pw_run *r, long evaluations, long iterations) {
  r->statistics.rhs += evaluations;
  r->statistics.specialised += evaluations;
  r->statistics.factorisations += evaluations + iterations;
}

/* After an evaluation at (q, v): makes the workspace and the saddle consistent with it, and counts it. */
static void specialised_finish (pw_run *r, const double *q, const double *v, long iterations) {
  if (r->s->coords > 3 * r->s->bodies) pw_point_to_internal (r->w, q, v);
  pw_saddle_postpone (r->saddle, PW_SCENE_PIVOT);
  pw_specialised_count (r, 1, iterations);
}

int pw_specialised_evaluate (pw_run *r, double t, const double *q, const double *v, double *a, double *lambda) {
  if (!pw_specialised_suits (r)) return 0;
  if (r->specialised->evaluate (r->scene, t, q, v, a, lambda, r->w->configuration, r->w->J)) return 0;
  specialised_finish (r, q, v, 0);
  return 1;
}

/* The first stage of a step is the state reached, which has been evaluated. */
int pw_specialised_stages (pw_run *r, const pw_scene_step *x) {
  if (!pw_specialised_suits (r) || r->specialised->stages (r->scene, x)) return 0;
  pw_specialised_count (r, x->stages - 1, 0);
  return 1;
}

static void specialised_copy_residuals (pw_run *r) {
  const pw_scene *x = r->scene;
  r->residuals = (pw_residuals){ .position = x->position, .g = x->g, .velocity = x->velocity, .jv = x->jv };
}

int pw_specialised_project (const pw_projector *p, pw_run *r, double t, double *q, double *v, double *a,
                            double *lambda) {
  if (p->owns_velocity || !pw_specialised_suits (r)) return 0;
  if (r->specialised->project (r->scene, t, q, v, a, lambda, r->w->configuration, r->w->J)) return 0;
  specialised_finish (r, q, v, r->scene->iterations);
  if (r->active)
    pw_forget_residuals (r);
  else
    specialised_copy_residuals (r);
  return 1;
}

void pw_specialised_residuals (pw_run *r) {
  if (!pw_specialised_suits (r) || r->active || !isnan (r->residuals.position) || !isnan (r->residuals.velocity))
    return;
  r->specialised->residuals (r->scene, r->q, r->v, r->w->configuration, r->w->J);
  specialised_copy_residuals (r);
}
