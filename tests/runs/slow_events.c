/* Random vehicles: no event is missed and none invented against a run with a hundredth of the step, nor by another
 * method.  COUNT in the environment: how many, 100 by default; SEED: of the first one. */
#include <math.h>
#include <stdlib.h>
#include "check.h"
#include "random_vehicle.h"

enum { EVENTS_LISTS = 3 };

/* The events of a vehicle, by several methods. */
typedef struct {
  double time[RANDOM_EVENTS];
  int row[RANDOM_EVENTS], count;
} events_list;

static events_list events_lists[EVENTS_LISTS];

static long events_number (const char *name, long otherwise) {
  const char *text = getenv (name);
  return text ? strtol (text, NULL, 10) : otherwise;
}

/* The first event that differs from those of list 0 by more than `bound`; -1: none. */
static int events_differ (const events_list *x, double bound) {
  const events_list *of = &events_lists[0];
  const int count = x->count < of->count ? x->count : of->count;
  for (int k = 0; k < count; k++)
    if (x->row[k] != of->row[k] || !(fabs (x->time[k] - of->time[k]) <= bound)) return k;
  return x->count == of->count ? -1 : count;
}

static void events_show (long n, unsigned seed, const char *what, const events_list *x, int k) {
  print_message ("vehicle %ld, seed %u, %s: event %d\n", n, seed, what, k);
  for (int i = 0; i < 2; i++) {
    const events_list *l = i ? x : &events_lists[0];
    print_message ("   %d events:", l->count);
    for (int j = k > 1 ? k - 2 : 0; j < l->count && j < k + 4; j++)
      print_message (" %.11g (%d %d)", l->time[j], (l->row[j] + 4) / 8, (l->row[j] + 4) % 8 - 4);
    print_message ("\n");
  }
}

/* Lists 1 and 2 are compared with 0; methods, steps and bounds of each.  permitted: the fraction that may differ. */
static void events_campaign (const char *name, int rolls, long count, unsigned seed, const char *const method[],
                             const double *step, const double *bound, double permitted) {
  long differ[EVENTS_LISTS] = { 0 }, events = 0;
  for (long n = 0; n < count; n++) {
    const unsigned own = seed;
    pw_system *s = random_vehicle (&seed, rolls);
    for (int i = 0; i < EVENTS_LISTS && method[i]; i++) {
      events_list *x = &events_lists[i];
      x->count = random_vehicle_events (s, method[i], step[i], 3, x->time, x->row);
      const int k = i > 0 ? events_differ (x, bound[i]) : -1;
      if (k >= 0) differ[i]++, events_show (n, own, method[i], x, k);
    }
    events += events_lists[0].count;
    pw_system_free (s);
  }
  print_message ("%s: %ld vehicles, %ld events", name, count, events);
  for (int i = 1; i < EVENTS_LISTS && method[i]; i++) print_message ("; %s differs in %ld", method[i], differ[i]);
  print_message ("\n");
  for (int i = 1; i < EVENTS_LISTS; i++) assert_true ((double)differ[i] <= permitted * (double)(count + 20));
}

/* Times of events that end a phase too short to be resolved, of some microseconds, are its length apart. */
TEST (knife_edges) {
  static const char *const method[] = { "rk4+projection", "rk4+projection", "erk8+projection" };
  events_campaign ("knife edges", 0, events_number ("COUNT", 100), (unsigned)events_number ("SEED", 1), method,
                   (const double[]){ 1e-4, 1e-2, 0 }, (const double[]){ 0, 1e-4, 1e-5 }, 0);
}

/* Where sliding on a circle begins and ends, changes within the zone in which its direction is smoothed are not
 * resolved: of 2500 vehicles with 49,463 events, 15 differ (docs/events.md). */
TEST (rolling) {
  static const char *const method[] = { "erk8+projection", "radau+ggl", NULL };
  events_campaign ("rolling wheels", 1, events_number ("COUNT", 100) / 4, (unsigned)events_number ("SEED", 1), method,
                   (const double[]){ 0, 0, 0 }, (const double[]){ 0, 1e-6, 0 }, 0.03);
}
