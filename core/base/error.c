/* Records errors: a pw_error keeps the first one, with its text cut to fit and made printable. */
#include <stdarg.h>
#include "util.h"

int pw_fail (pw_error *error, int status, const char *format, ...) {
  if (error == NULL || error->status != PW_OK) return status;
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (error->text, sizeof error->text, format, arguments);
  va_end (arguments);
  pw_text_sanitise (error->text);
  error->status = status;
  return status;
}
