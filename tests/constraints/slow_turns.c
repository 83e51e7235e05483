/* Methods without projection, at many tolerances, through singular configurations: correct, or stopped by an error. */
#include "check.h"
#include "turns.h"

static const char *const turns_methods[] = {
  "erk5+none",       "erk5+baumgarte", "erk8+none",     "erk8+baumgarte", "adams+none",
  "adams+baumgarte", "bdf+none",       "bdf+baumgarte", "ida+none",       "ida+baumgarte",
  "ida+index2",      "ida+ggl",        "ida+si1",       "galpha+index3",  "galpha+ggl",
};

TEST (turns) {
  static const double rtol[] = { 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8 };
  static const struct {
    const char *model;
    double value; /* gravity, or number of couplers; see turns.h */
  } models[] = { { "slider-crank", 0 }, { "slider-crank", 9.81 }, { "n-four-bar", 1 },
                 { "n-four-bar", 2 },   { "n-four-bar", 3 },      { "n-four-bar", 6 } };
  for (size_t m = 0; m < sizeof models / sizeof *models; m++)
    for (size_t i = 0; i < sizeof turns_methods / sizeof *turns_methods; i++) {
      /* galpha's fixed step is 20 rtol: too small for the last two */
      size_t levels = sizeof rtol / sizeof *rtol - (turns_methods[i][0] == 'g' ? 2 : 0);
      for (size_t k = 0; k < levels; k++) turns_try (turns_methods[i], rtol[k], models[m].model, models[m].value);
    }
}
