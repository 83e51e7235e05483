/* The energy of a run and its ledger of work, losses and integrals: scales, tolerance, energy defect.  Every run keeps
 * a ledger, since samples contain the total work and loss; in adaptive Runge-Kutta methods, radau included, its error
 * takes part in step-size control. */
#include <float.h>
#include <math.h>
#include <string.h>
#include "method.h"
#include "rank.h"

/* Kinetic energy [J] of the scene moving by L and turning by 1 rad in the span of the run. */
static double ledger_scene_energy (const pw_run *r) {
  const pw_system *s = r->s;
  double sum = 0;
  for (int j = 0; j < s->coords; j++) sum += 0.5 * s->M[j] * pw_unit (s, j) * pw_unit (s, j);
  return sum / (r->settings.span * r->settings.span);
}

/* Evaluates kinematics at an arbitrary state: displaced by about L and 1 rad, at velocities of about L / T and 1 / T,
 * at the time t.  A status. */
static int ledger_displace (pw_run *r, double t) {
  double *q = r->scratch, *v = q + r->s->coords + 3;
  for (int j = 0; j < r->s->coords; j++) {
    double displacement = pw_unit (r->s, j) * (1 + 0.37 * (j % 5)) / 2;
    q[j] = r->q[j] + displacement;
    v[j] = displacement / r->w->scale.time;
  }
  return pw_update_kinematics (r->w, t, q, v);
}

static void ledger_return (pw_run *r) {
  r->w->failed = NULL;
  pw_update_kinematics (r->w, r->t, r->q, r->v);
}

/* Energy scale [J] of a massless scene: work and losses in a time T at the velocities of an arbitrary state, and the
 * change of potential energy. */
static double ledger_massless_energy (pw_run *r) {
  const pw_system *s = r->s;
  double *lambda = r->lambda_at, T = r->w->scale.time, sum = 0;
  memset (lambda, 0, (size_t)s->rows * sizeof *lambda);
  if (ledger_displace (r, r->t) == PW_OK) {
    pw_evaluate_ledger (r->w, lambda, r->ledger_at);
    for (int i = 0; i < s->entries; i++) sum += T * fabs (r->ledger_at[i]);
    sum += fabs (pw_potential (r->w) - r->potential0);
  }
  ledger_return (r);
  return sum;
}

/* Evaluates the integrands at the state of the workspace; power: those of the ledger's entries. */
static void ledger_integrands (pw_run *r, const double *lambda, const double *power, double *value) {
  const pw_system *s = r->s;
  double *q = r->integrand_state, *v = q + s->coords;
  for (int b = 0; b < s->bodies; b++) {
    const pw_configuration *c = &r->w->configuration[b];
    q[3 * b] = c->x, q[3 * b + 1] = c->y, q[3 * b + 2] = c->phi;
    v[3 * b] = c->vx, v[3 * b + 1] = c->vy, v[3 * b + 2] = c->omega;
  }
  for (const pw_element_batch *k = r->w->batch; k < r->w->batch + s->batches; k++)
    for (int j = 0; j < k->b.count * k->kind->internal; j++)
      q[k->internal + j] = k->b.q[j], v[k->internal + j] = k->b.v[j];
  pw_sample state = { .t = r->w->t_signal,
                      .q = q,
                      .v = v,
                      .lambda = lambda,
                      .kinetic = pw_kinetic (s, v),
                      .potential = pw_potential (r->w),
                      .ledger = power };
  for (int i = 0; i < s->entries; i++) *(s->entry[i].type == PW_WORK ? &state.work : &state.loss) += power[i];
  r->settings.integrand (r->settings.integrand_context, &state, value);
}

static void ledger_record_integrands (pw_run *r, const double *value) {
  for (int i = 0; i < r->settings.integrals; i++)
    if (isfinite (value[i])) r->integrand_size[i] = fmax (r->integrand_size[i], fabs (value[i]));
}

/* Sizes of integrands that may be zero on the way: those at an arbitrary state after a time T, with multipliers that
 * accelerate the scene by L / T^2. */
static void ledger_measure_integrands (pw_run *r) {
  const pw_system *s = r->s;
  double *lambda = r->lambda_at, T = r->w->scale.time, energy = 0;
  for (int j = 0; j < s->coords; j++) energy += s->mass[j] * pw_unit (s, j) * pw_unit (s, j) / (T * T);
  for (int i = 0; i < s->rows; i++) lambda[i] = energy / s->scale.length * pw_rank_multiplier_unit (r->w, i);
  if (ledger_displace (r, r->t + T) == PW_OK) {
    pw_evaluate_ledger (r->w, lambda, r->ledger_at);
    ledger_integrands (r, lambda, r->ledger_at, r->ledger_at + s->entries);
    ledger_record_integrands (r, r->ledger_at + s->entries);
  }
  ledger_return (r);
}

void pw_ledger_begin (pw_run *r) {
  r->potential0 = pw_potential (r->w);
  r->exchanged = pw_kinetic (r->s, r->v);
  r->energy0 = r->exchanged + r->potential0;
  r->scene_energy = ledger_scene_energy (r);
  if (r->scene_energy == 0 && r->s->entries > 0) r->scene_energy = ledger_massless_energy (r);
  if (r->settings.integrals) ledger_measure_integrands (r);
  ledger_record_integrands (r, r->rate + r->s->entries);
}

/* Samples the first PW_CHECK_INTERVAL steps and every PW_CHECK_INTERVAL-th: sufficient for a scale, at negligible
 * cost. */
void pw_ledger_record (pw_run *r) {
  double power = 0;
  ledger_record_integrands (r, r->rate + r->s->entries);
  if (r->statistics.steps > PW_CHECK_INTERVAL && r->statistics.steps % PW_CHECK_INTERVAL != 0) return;
  double exchanged = fmax (pw_kinetic (r->s, r->v), fabs (pw_potential (r->w) - r->potential0));
  for (int i = 0; i < r->s->entries; i++) power += fabs (r->rate[i]);
  if (exchanged > r->exchanged && isfinite (exchanged)) r->exchanged = exchanged;
  if (power > r->power && isfinite (power)) r->power = power;
}

void pw_ledger_rates (pw_run *r, const double *lambda, double *rate) {
  const int integrals = r->settings.integrals, unique = r->redundant_drive || (integrals && r->redundant);
  if (unique && pw_saddle_factor (r->saddle) == PW_OK) {
    memcpy (r->least_norm, lambda, (size_t)r->s->rows * sizeof *lambda);
    pw_rank_least_norm (r, r->least_norm);
    lambda = r->least_norm;
  }
  pw_evaluate_ledger (r->w, lambda, rate);
  if (integrals) ledger_integrands (r, lambda, rate, rate + r->s->entries);
}

int pw_ledger_uses_multipliers (const pw_run *r) {
  const pw_system *s = r->s;
  int reacts = r->settings.integrals > 0 && s->rows > 0;
  for (int i = 0; i < s->entries; i++) reacts |= s->batch[s->entry[i].batch].kind->rows > 0;
  return reacts;
}

/* If kinetic and potential energies are negligible, as for light bodies against friction, the scale is the work done,
 * which grows without bound; so that of a time T at the most. */
static const double ledger_share =
                        5,    /* sqrt (25): the error of one of 25 states whose root mean square is 1 tolerance */
    ledger_round_off = 1e-11; /* of powers and integrands, due to multipliers */

double pw_ledger_tolerance (const pw_run *r, double h) {
  const pw_settings *settings = &r->settings;
  double work = 0, rtol = fmax (settings->rtol, settings->atol > 0 ? settings->atol / fmax (r->s->scale.length, 1) : 0);
  for (int i = 0; i < r->s->entries; i++) work += fabs (r->ledger[i]);
  double energy = fmax (fmax (r->scene_energy, r->exchanged), fmin (work, r->power * r->w->scale.time));
  double tolerance = ledger_share * rtol * energy + ledger_round_off * fabs (h) * r->power + 16 * DBL_EPSILON * work;
  return tolerance > 0 && isfinite (tolerance) ? tolerance : DBL_MAX;
}

double pw_ledger_norm (const pw_run *r, double h, const double *change) {
  const double tolerance = pw_ledger_tolerance (r, h), T = r->w->scale.time;
  double sum = 0;
  for (int i = 0; i < r->entries; i++) {
    const int k = i - r->s->entries;
    double own = k < 0 ? tolerance
                       : r->integrand_size[k] * (ledger_share * r->settings.rtol * T + ledger_round_off * fabs (h)) +
                             16 * DBL_EPSILON * fabs (r->ledger[i]);
    if (own > 0) sum += change[i] / own * (change[i] / own);
  }
  return sqrt (sum);
}

double pw_run_energy_defect (const pw_run *r, const pw_sample *sample) {
  double defect = sample->kinetic + sample->potential - r->energy0 - sample->work + sample->loss;
  double scale = fmax (r->exchanged, fmax (sample->kinetic, fabs (sample->potential - r->potential0)));
  scale = fmax (scale, ledger_scene_energy (r));
  if (scale == 0) scale = fmax (fabs (sample->work), sample->loss); /* no masses, no stored energy */
  return defect == 0 ? 0 : fabs (defect) / scale;
}

const char *pw_run_energy_advice (const pw_run *r, double defect) {
  const double least_rtol = 1e-12; /* smaller ones gain little over round-off */
  const double per_step = 10;      /* acceptable defect of a step over rtol */
  const pw_statistics *now = &r->statistics;
  int projects = pw_stabilised_by (r, PW_PROJECTION);
  if (!projects && fmax (now->position, now->velocity) > 0.1 * defect)
    return "the constraints have drifted; a method with projection satisfies them";
  if (r->fixed_steps) return "a smaller step, or another method, follows the motion better";
  if (r->settings.rtol <= least_rtol) return "the tolerance cannot be much smaller; compare with another method";
  if (defect > per_step * r->settings.rtol * (double)now->steps)
    return "that is more than the tolerance explains; compare with another method";
  return "a smaller tolerance, or another method, follows the motion better";
}
