/* The energy of a run and its ledger of work and losses: scales, tolerance, energy defect.  Every run keeps a ledger,
 * since samples contain the total work and loss; in adaptive Runge-Kutta methods, radau included, its error takes part
 * in step-size control. */
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

/* Energy scale [J] of a massless scene: work and losses in a time T at arbitrary velocities of about L / T and 1 / T,
 * and the change of potential energy by arbitrary displacements of about L and 1 rad.  Afterwards kinematics are those
 * of the state reached. */
static double ledger_massless_energy (pw_run *r) {
  const pw_system *s = r->s;
  double *q = r->scratch, *v = q + s->coords + 3, *lambda = v + s->coords + 3, T = r->w->scale.time, sum = 0;
  for (int j = 0; j < s->coords; j++) {
    double displacement = pw_unit (s, j) * (1 + 0.37 * (j % 5)) / 2;
    q[j] = r->q[j] + displacement;
    v[j] = displacement / T;
  }
  memset (lambda, 0, (size_t)s->rows * sizeof *lambda);
  if (pw_update_kinematics (r->w, r->t, q, v) == PW_OK) {
    pw_evaluate_ledger (r->w, lambda, r->ledger_at);
    for (int i = 0; i < s->entries; i++) sum += T * fabs (r->ledger_at[i]);
    sum += fabs (pw_potential (r->w) - r->potential0);
  }
  r->w->failed = NULL;
  pw_update_kinematics (r->w, r->t, r->q, r->v);
  return sum;
}

void pw_ledger_begin (pw_run *r) {
  r->potential0 = pw_potential (r->w);
  r->exchanged = pw_kinetic (r->s, r->v);
  r->energy0 = r->exchanged + r->potential0;
  r->scene_energy = ledger_scene_energy (r);
  if (r->scene_energy == 0 && r->s->entries > 0) r->scene_energy = ledger_massless_energy (r);
}

/* Samples the first PW_CHECK_INTERVAL steps and every PW_CHECK_INTERVAL-th: sufficient for a scale, at negligible
 * cost. */
void pw_ledger_record (pw_run *r) {
  double power = 0;
  if (r->statistics.steps > PW_CHECK_INTERVAL && r->statistics.steps % PW_CHECK_INTERVAL != 0) return;
  double exchanged = fmax (pw_kinetic (r->s, r->v), fabs (pw_potential (r->w) - r->potential0));
  for (int i = 0; i < r->s->entries; i++) power += fabs (r->rate[i]);
  if (exchanged > r->exchanged && isfinite (exchanged)) r->exchanged = exchanged;
  if (power > r->power && isfinite (power)) r->power = power;
}

void pw_ledger_rates (pw_run *r, const double *lambda, double *rate) {
  if (r->redundant_drive && pw_saddle_factor (r->saddle) == PW_OK) {
    memcpy (r->least_norm, lambda, (size_t)r->s->rows * sizeof *lambda);
    pw_rank_least_norm (r, r->least_norm);
    lambda = r->least_norm;
  }
  pw_evaluate_ledger (r->w, lambda, rate);
}

int pw_ledger_uses_multipliers (const pw_system *s) {
  int reacts = 0;
  for (int i = 0; i < s->entries; i++) reacts |= s->batch[s->entry[i].batch].kind->rows > 0;
  return reacts;
}

/* If kinetic and potential energies are negligible, as for light bodies against friction, the scale is the work done,
 * which grows without bound; so that of a time T at the most. */
double pw_ledger_tolerance (const pw_run *r, double h) {
  const double share = 5;         /* sqrt (25): the error of one of 25 states whose root mean square is 1 tolerance */
  const double round_off = 1e-11; /* of powers, due to multipliers */
  const pw_settings *settings = &r->settings;
  double work = 0, rtol = fmax (settings->rtol, settings->atol > 0 ? settings->atol / fmax (r->s->scale.length, 1) : 0);
  for (int i = 0; i < r->s->entries; i++) work += fabs (r->ledger[i]);
  double energy = fmax (fmax (r->scene_energy, r->exchanged), fmin (work, r->power * r->w->scale.time));
  double tolerance = share * rtol * energy + round_off * fabs (h) * r->power + 16 * DBL_EPSILON * work;
  return tolerance > 0 && isfinite (tolerance) ? tolerance : DBL_MAX;
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
