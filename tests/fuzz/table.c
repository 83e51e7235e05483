/* Two columns of a CSV file. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include "files.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size) {
  static const char *const column[][2] = { { "1", "2" }, { "time", "torque" }, { "2", "1" } };
  static const char *const unit[2] = { "s", "N m" };
  pw_error error = { 0 };
  int count = 0;
  double last = -INFINITY;
  if (size < 2) return 0;
  FILE *f = fmemopen ((void *)(size_t)(data + 1), size - 1, "rb");
  if (f == NULL) return 0;
  double *t =
      pw_columns_from_stream (f, "data.csv", column[data[0] % 3], unit, 2, PW_GAPS_REFUSED, NULL, &count, &error);
  for (int i = 0; t && i < count; i++) {
    if (isinf (t[i]) || isinf (t[count + i])) abort (); /* NaN: an empty cell */
    if (t[i] <= last) abort ();
    if (!isnan (t[i])) last = t[i];
  }
  if (t == NULL && error.status >= 0) abort ();
  fclose (f);
  free (t);
  return 0;
}

static fuzz_grammar table_rules[] = {
  "f:$i$h$l$l$l`$i$l$l`$i#$h$h$l$l$l",
  "i:0`1`2",
  "h:time$u$stime$u\n`time$u$storque$u\n`torque$u$stime$u$s$c\n`\"time$u\"$s\"torque$u\"\n`\n",
  "l:$c$s$c\n`$c$s$c\n`$c$s$c$s$c\n`$c$s$c\r\n`$l$l`\n`# $c\n",
  "s:,`;`\t` ",
  "u:` [$v]` ($v)`[$v]",
  "v:s`ms`N m`N mm`kN*m`$v/$v`$v^$p`$v $v`deg`rad/s`min`h`us`km`1`-`\xC2\xB5s`\xC2\xB0",
  "p:2`-1`9`0`-9",
  "c:$d`$d,$d``$d.$d`-$d`$de$d`$de-$d` $d `\"$d\"`\"$d$s$d\"`\"$d`nan`inf`0x1p3``1e308`1e-308`t",
  "d:1`2`3`4`10`99`0`5",
  NULL
};

size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed) {
  return fuzz_mutate (table_rules, data, size, most, seed);
}
