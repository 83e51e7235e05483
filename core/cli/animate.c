/* Animations: the ending of the file's name says which. */
#include <string.h>
#include <strings.h>
#include "animate.h"
#include "animate_page.h"

static int animate_ends (const char *path, const char *ending) {
  size_t n = strlen (path), m = strlen (ending);
  return n > m && strcasecmp (path + n - m, ending) == 0;
}

int pw_animation_check (const char *path, pw_error *error) {
  if (animate_ends (path, ".html") || animate_ends (path, ".gif")) return PW_OK;
  return pw_fail (error, PW_INPUT, "--animate %s: expected a name that ends in .html or .gif", path);
}

int pw_animate (pw_plots *p, const char *path, const char *method, const char *reason, pw_error *error) {
  if (p->samples < 2) {
    fprintf (stderr, "pinwheel: the run is too short for an animation: %s is not written\n", path);
    return PW_OK;
  }
  if (animate_ends (path, ".gif")) return pw_animate_gif (p, path, error);
  return pw_animate_page (p, path, method, reason, error);
}
