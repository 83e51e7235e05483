/* Tables of text models: formats of their files, the folders in which these may be, times, coverage of a run. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "model.h"
#include "pinwheel-files.h"

/* Builds a model in the subfolder "model" whose torque is this table; the signal goes to *signal, its first points to
 * `point`. */
static pw_error table_build (const char *table, pw_signal *signal, double point[2][3]) {
  pw_error error = { 0 };
  cli_write ("model/m.yaml", check_text ("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                                         "elements: [{torque: T, body: [a, ground], value: {table: %s}}]\n",
                                         table));
  pw_file *f = pw_file_open (cli_path ("model/m.yaml"), &error);
  pw_model *m = f ? pw_file_model (f, &error) : NULL;
  if (m && pw_model_build (m, &error) == PW_OK) {
    *signal = ((const pw_torque *)m->element[0].definition)->value;
    for (int i = 0; i < 3 && i < signal->table.count; i++)
      point[0][i] = signal->table.t[i], point[1][i] = signal->table.value[i];
    pw_system_free (pw_system_compile (m, &error));
  }
  pw_model_free (m);
  pw_file_close (f);
  return error;
}

/* Whatever the form, these are its points: (0, 1), (0.5, -2), (2, 3e-1). */
static void table_good (const char *csv, const char *table) {
  pw_signal s = { 0 };
  double point[2][3];
  cli_write ("model/data.csv", csv);
  pw_error error = table_build (table, &s, point);
  check_ok (error.status, &error);
  assert_true (s.type == PW_TABLE && s.table.count == 3);
  assert_true (point[0][0] == 0 && point[0][1] == 0.5 && point[0][2] == 2);
  assert_true (point[1][0] == 1 && point[1][1] == -2 && point[1][2] == 0.3);
}

TEST (forms) {
  table_good ("", "{points: [[0, 1], [1/2, -2], [2, 0.3]]}");
  table_good ("0,1\n0.5,-2\n2,3e-1\n", "{file: data.csv}");
  table_good ("0,1\n0.5,-2\n2,3e-1", "{file: ./data.csv, columns: [1, 2]}");
  table_good ("0;1\r\n0.5;-2\r\n2;3e-1\r\n", "{file: data.csv}");
  table_good ("a\tt\tb\n1\t0\t\n-2\t0.5\t\n3e-1\t2\t\n", "{file: data.csv, columns: [t, a]}");
  table_good ("t\ta\t\n0\t1\t\n0.5\t-2\t\n2\t3e-1\t\n\t\t\n", "{file: data.csv}");
  table_good ("\xEF\xBB\xBF# by hand\n\nt [s], \"M [N m]\" ,t2\n 0 , 1,5\n#\n0.5,-2,5\n\n2,3e-1,5\n",
              "{file: data.csv, columns: [t, M]}");
  table_good ("t,\"M, left\",c\n0,1,\"a,b\"\n\"0.5\",-2,\"\"\n2,\"3e-1\",\" \"\"c\"\", \"\n",
              "{file: data.csv, columns: [t, \"M, left\"]}");
  table_good ("t;\"M \"\"1\"\", 2\"\n0;1\n0.5;-2\n2;3e-1\n", "{file: data.csv, columns: [t, 'M \"1\", 2']}");
  table_good ("x,t [s],M [N m]\n9,0,1\n9,0.5,-2\n9,2,3e-1\n", "{file: data.csv, columns: [2, \"M [N m]\"]}");
}

static void table_bad (const char *table, const char *text) {
  pw_signal s;
  double point[2][3];
  pw_error error = table_build (table, &s, point);
  assert_int_equal (error.status, PW_INPUT);
  if (strstr (error.text, text) == NULL) print_error ("told:\n%s\nexpected:\n%s\n", error.text, text);
  assert_non_null (strstr (error.text, text));
}

/* A header's unit converts its column, however it is written. */
TEST (units) {
  static const char *const unit[] = { "[N mm]", "[mN m]", "[N*mm]", "[kN um]", "[g m^2/s^2]", "[Nmm]", "(N mm)" };
  char csv[200];
  for (size_t i = 0; i < sizeof unit / sizeof *unit; i++) {
    snprintf (csv, sizeof csv, "t [ms],u %s\n0,1000\n500,-2000\n2000,300\n", unit[i]);
    table_good (csv, "{file: data.csv}");
    table_good (csv, "{file: data.csv, columns: [t, u]}");
  }
  table_good ("t[min],u[kg m\xC2\xB2/s\xC2\xB2]\n0,1\n8.3333333333333333e-3,-2\n0.033333333333333333,.3\n",
              "{file: data.csv}");
  table_good ("t,u (as measured),v\n0,1,x\n0.5,-2,x\n2,.3,x\n", "{file: data.csv}");
  table_good ("t [s],u [-]\n0,1\n0.5,-2\n2,.3\n", "{file: data.csv}");
}

/* What is not known, or measures something else, is refused with column and unit. */
TEST (bad_units) {
  static const char csv[] = "t [s],u [dyn cm],w [deg],f [N],z [N m/],h [%],d [·]\n0,1,2,3,4,5,6\n1,2,3,4,5,6,7\n";
  cli_write ("model/u.csv", csv);
  table_bad ("{file: u.csv}", "u.csv:1: column \"u [dyn cm]\": the unit \"dyn cm\" is not known; expected N m");
  table_bad ("{file: u.csv, columns: [t, w]}", "column \"w [deg]\": the unit \"deg\" does not measure what N m does");
  table_bad ("{file: u.csv, columns: [t, f]}", "column \"f [N]\": the unit \"N\" does not measure what N m does");
  table_bad ("{file: u.csv, columns: [t, z]}", "the unit \"N m/\" is not known");
  table_bad ("{file: u.csv, columns: [t, h]}", "the unit \"%\" is not known");
  table_bad ("{file: u.csv, columns: [t, d]}", "the unit \"·\" is not known");
  table_bad ("{file: u.csv, columns: [f, z]}", "column \"f [N]\": the unit \"N\" does not measure what s does");
}

/* What overflows as it is converted is refused. */
TEST (too_large) {
  static const char csv[] = "t [h],u [kN km]\n0,1\n1,-1e303\n1e305,2\n";
  cli_write ("model/large.csv", csv);
  table_bad ("{file: large.csv}", "large.csv:3: column 2: \"-1e303\" is too large in SI units");
  cli_write ("model/large.csv", "t [h],u\n0,1\n1e305,2\n");
  table_bad ("{file: large.csv}", "large.csv:3: column 1: \"1e305\" is too large in SI units");
}

/* Cells are not cut: neither a number before its exponent nor a name before its unit. */
TEST (long_cells) {
  char csv[3000];
  snprintf (csv, sizeof csv, "t,%0150d [N mm]\n0,1.%0150de3\n0.5,-2e3\n2,300\n", 0, 0);
  csv[2] = 'M'; /* a name */
  table_good (csv, "{file: data.csv}");
  snprintf (csv, sizeof csv, "0,1\n0.5,-2\n2,3.%01500de-1\n", 0);
  cli_write ("model/data.csv", csv);
  table_bad ("{file: data.csv}", "data.csv:3: column 2: expected a finite number, found \"3.000");
  snprintf (csv, sizeof csv, "t,M%01500d [N mm]\n0,1\n0.5,-2\n2,3\n", 0);
  cli_write ("model/data.csv", csv);
  table_bad ("{file: data.csv}", "data.csv:1: the name of column 2 is too long");
}

/* The unit a signal has: of a drive, that of what it drives. */
static void table_unit (const char *element, const char *header, double expected, const char *text) {
  pw_error error = { 0 };
  cli_write ("model/data.csv", check_text ("t,u [%s]\n0,0\n1,90\n", header));
  cli_write ("model/m.yaml",
             check_text ("pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                         "elements: [{%s: {table: {file: data.csv, interpolation: cubic, ends: rest}}}]\n",
                         element));
  pw_file *f = pw_file_open (cli_path ("model/m.yaml"), &error);
  pw_model *m = f ? pw_file_model (f, &error) : NULL;
  assert_non_null (m);
  int status = pw_model_build (m, &error);
  if (text) {
    assert_int_equal (status, PW_INPUT);
    assert_non_null (strstr (error.text, text));
  } else {
    check_ok (status, &error);
    const pw_signal *s = pw_field_at (m->element[0].kind, m->element[0].definition, PW_SIGNAL, 0);
    check_close (header, s->table.value[1], expected, 4 * CHECK_EPS * expected, "a product or two");
  }
  pw_model_free (m);
  pw_file_close (f);
}

TEST (unit_of_signal) {
  static const char angle[] = "drive: D, body: [a, ground], at: [[0, 0], [0, 0]], what: angle, value",
                    x[] = "drive: D, body: [a, ground], at: [[0, 0], [0, 0]], what: x, value",
                    speed[] = "speed: V, body: a, at: [0, 0], value",
                    pfaffian[] = "pfaffian: P, body: [a, ground], a: [1, 0, 0], b: [0, 0, 0], value";
  table_unit (angle, "deg", PW_PI / 2, NULL);
  table_unit (angle, "\xC2\xB0", PW_PI / 2, NULL);
  table_unit (angle, "rev", 180 * PW_PI, NULL);
  table_unit (angle, "mm", 0, "the unit \"mm\" does not measure what rad does");
  table_unit (x, "mm", 0.09, NULL);
  table_unit (x, "deg", 0, "the unit \"deg\" does not measure what m does");
  table_unit (x, "\xC2\xB5m", 9e-5, NULL);
  table_unit (x, "\xCE\xBCm", 9e-5, NULL);
  table_unit (speed, "km/h", 25, NULL);
  table_unit (pfaffian, "cm", 0.9, NULL); /* any: its coefficients may have units */
  table_unit (speed, "rpm", 0, "does not measure what m/s does");
  table_unit (pfaffian, "11 cm", 0, "the unit \"11 cm\" is not known");
  table_unit (pfaffian, "12", 0, "the unit \"12\" is not known");
  table_unit (pfaffian, "cm^", 0, "the unit \"cm^\" is not known");
}

/* 90 of each unit, in SI units. */
TEST (unit_factors) {
  static const struct {
    const char *unit;
    double si;
  } units[] = {
    { "m", 90 },
    { "kg", 90 },
    { "s", 90 },
    { "rad", 90 },
    { "N", 90 },
    { "J", 90 },
    { "W", 90 },
    { "degrees", PW_PI / 2 },
    { "degree", PW_PI / 2 },
    { "deg", PW_PI / 2 },
    { "grad", 0.45 * PW_PI },
    { "gon", 0.45 * PW_PI },
    { "mrad", 0.09 },
    { "rev", 180 * PW_PI },
    { "rpm", 3 * PW_PI },
    { "km/h", 25 },
    { "mph", 40.2336 },
    { "ft", 27.432 },
    { "in", 2.286 },
    { "mi", 144840.96 },
    { "lb", 40.8233133 },
    { "lbf", 400.339945373445 },
    { "um", 9e-5 },
    { "mm", 0.09 },
    { "cm", 0.9 },
    { "dm", 9 },
    { "km", 9e4 },
    { "us", 9e-5 },
    { "ms", 0.09 },
    { "min", 5400 },
    { "h", 324000 },
    { "mN", 0.09 },
    { "kN", 9e4 },
    { "MN", 9e7 },
    { "Nm", 90 },
    { "kNm", 9e4 },
    { "Nmm", 0.09 },
    { "g", 0.09 },
    { "kJ", 9e4 },
    { "kW", 9e4 },
    { "cm^2", 9e-3 },
    { "1/ms", 9e4 },
  };
  for (size_t i = 0; i < sizeof units / sizeof *units; i++)
    table_unit ("pfaffian: P, body: [a, ground], a: [1, 0, 0], b: [0, 0, 0], value", units[i].unit, units[i].si, NULL);
}

/* offset + scale value, at the compiled signal; the points stay as they are. */
TEST (scale) {
  pw_signal s = { 0 };
  double point[2][3];
  cli_write ("model/data.csv", "0,1\n2,3\n");
  pw_error error = table_build ("{file: data.csv, scale: 2*deg, offset: -1}", &s, point);
  check_ok (error.status, &error);
  assert_true (s.table.scale == 2 * (PW_PI / 180) && s.table.offset == -1 && point[1][1] == 3);
  table_bad ("{points: [[0, 1], [1, 2]], scale: 0}", "scale: 0 is not permitted");
  table_bad ("{points: [[0, 1], [1, 1e300]], scale: 1e300}", "point 2: offset + scale * 1e+300 is not finite");
}

/* Too few descriptors are not the model's fault. */
TEST (descriptors) {
  pw_error error = { 0 };
  struct rlimit old;
  cli_write ("model/data.csv", "0,1\n1,2\n");
  cli_write ("model/m.yaml", "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                             "elements: [{torque: T, body: [a, ground], value: {table: {file: data.csv}}}]\n");
  pw_file *f = pw_file_open (cli_path ("model/m.yaml"), &error);
  pw_model *m = pw_file_model (f, &error);
  assert_int_equal (getrlimit (RLIMIT_NOFILE, &old), 0);
  assert_int_equal (setrlimit (RLIMIT_NOFILE, &(struct rlimit){ 0, old.rlim_max }), 0);
  int status = pw_model_build (m, &error);
  assert_int_equal (setrlimit (RLIMIT_NOFILE, &old), 0);
  assert_int_equal (status, PW_RESOURCE);
  assert_non_null (strstr (error.text, "m.yaml: cannot read data.csv: Too many open files"));
  pw_model_free (m);
  pw_file_close (f);
}

TEST (contents) {
  cli_write_bytes ("model/nul.csv", "0,1\n1,\0002\n", 9);
  table_bad ("{file: nul.csv}", "value: nul.csv: a table is text, and this has a byte 0\n");
  cli_write ("model/twice.csv", "t,u,u [m]\n0,1,2\n1,2,3\n");
  table_bad ("{file: twice.csv, columns: [t, u]}", "value: twice.csv:1: columns 2 and 3 are both named \"u\"\n");
}

/* Decimal commas, and blanks between cells: read where they are not ambiguous, otherwise refused with the remedy. */
TEST (separators) {
  static const char *const csv[] = { "0;1\n0,5;-2\n2;3e-1\n",
                                     "Zeit [s];M [N m]\n0,0;1,0\n0,5;-2,0\n2,0;0,3\n",
                                     "t\tM\n0,0\t1,0\r\n0,5\t-2\r\n2\t0,3\r\n",
                                     "0 1\n.5 -2\n2 .3\n",
                                     "  t [s]   M [N m]\n 0.0     1\n 0.5\t-2  \n 2     0.3\n",
                                     "t (s) M (mN m)\n0 1000\n0,5 -2000,0\n2 300\n",
                                     "# t M\n0,0 1,0\n\n0,5 -2,0\n2,0 0,3\n",
                                     "Position 1,Position 2\n0,1\n0.5,-2\n2,.3\n",
                                     "0, 1\n0.5, -2\n2, .3\n" };
  for (size_t i = 0; i < sizeof csv / sizeof *csv; i++) table_good (csv[i], "{file: data.csv}");
  cli_write ("model/data.csv", "t;\"M, left\"\n0;1,0\n0.5;-2\n2;3e-1\n");
  table_bad ("{file: data.csv}",
             "data.csv:3: column 1: a decimal point, but line 2 has a decimal comma: use one of them");
  static const char hint[] = "; with decimal commas, separate cells by semicolons or tabs";
  cli_write ("model/data.csv", "t,M\n0,0,1,5\n1,0,2,5\n");
  table_bad ("{file: data.csv}", check_text ("data.csv:2: expected 2 cells as in the first line, found 4%s", hint));
  cli_write ("model/data.csv", "t,M\n0,\"1,5\"\n1,\"2,5\"\n");
  table_bad ("{file: data.csv}", check_text ("column 2: expected a finite number, found \"1,5\"%s", hint));
  cli_write ("model/data.csv", "0,0,1,5\n1,0,2,5\n2,0,3,0\n");
  table_bad ("{file: data.csv}", "data.csv:1: without names, 4 cells of whole numbers: with decimal commas, separate");
  assert_true (table_build ("{file: data.csv, columns: [1, 3]}", &(pw_signal){ 0 }, (double[2][3]){ { 0 } }).status ==
               PW_OK);
  cli_write ("model/data.csv", "t;M\n0;1.234,5\n1;2\n");
  table_bad ("{file: data.csv}", "found \"1.234,5\"; nothing may separate thousands");
  cli_write ("model/data.csv", "t|M\n0|1\n1|2\n");
  table_bad ("{file: data.csv}", "the line has 1 cell; separate cells by commas, semicolons, tabs or blanks");
}

/* Times in other units and since an epoch; the column of times. */
TEST (times) {
  static const char csv[] = "M,ms,extra\n1,5000,0\n-2,5500,0\n3e-1,7000,0\n";
  table_good ("", "{points: [[1000, 1], [1500, -2], [3000, 0.3]], time_scale: 1e-3, time_offset: -1}");
  table_good (csv, "{file: data.csv, time: ms, time_scale: 1e-3, time_offset: -5}");
  table_good (csv, "{file: data.csv, time: 2, columns: [M], time_scale: 1/1000, time_offset: -5}");
  table_good (csv, "{file: data.csv, time: ms, columns: [ms, M], time_scale: 1e-3, time_offset: -5}");
  table_good (csv, "{file: data.csv, columns: [ms, M], time_scale: 1e-3, time_offset: -5}");
  table_good ("x,t\n0,1\n.5,-2\n2,.3\n", "{file: data.csv, time: x}");
  cli_write ("model/data.csv", csv);
  table_bad ("{file: data.csv, time: ns}", "there is no column \"ns\"; did you mean \"ms\"?");
  table_bad ("{file: data.csv, time: ms, columns: [M, extra]}", "but time is \"ms\"");
  table_bad ("{file: data.csv, time: ms, columns: [M, ms, extra]}",
             "expected a list of 1 column, [value], found one of 3");
  table_bad ("{points: [[0, 1], [1, 2]], time: t}", "a column of times belongs to a file");
  table_bad ("{points: [[0, 1], [1, 2]], time_scale: 0}", "time_scale = 0: expected a number > 0");
  table_bad ("{points: [[0, 1], [1, 2]], time_scale: -1}", "time_scale = -1: expected a number > 0");
  table_bad ("{points: [[0, 1], [1, 2]], time_offset: 1e200, time_scale: 1e-9}", "expected increasing times");
}

/* Rows with empty cells are left out and counted. */
TEST (gaps) {
  table_good ("t,M,x\n0,1,\n0.2,,\n0.5,-2,\n,9,\n2,.3,\n,,\n", "{file: data.csv}");
  table_good ("t;M\n;\n0;1,0\n0,2;\n0,5;-2,0\n2;0,3\n", "{file: data.csv}");
  cli_write ("model/data.csv", "t,M\n0,1\n0.2,\n,3\n");
  table_bad ("{file: data.csv}", "a linear table needs at least 2 points, found 1 and 2 rows with empty cells");
  cli_write ("model/data.csv", "t,M\n0,1\n,\n-1,3\n");
  table_bad ("{file: data.csv}", "data.csv:4: -1 comes after 0: expected increasing times");
}

/* Which part of a run from 0 to 10 s the table covers. */
static void table_covers (const char *table, const char *text) {
  pw_error error = table_build (table, &(pw_signal){ 0 }, (double[2][3]){ { 0 } });
  check_ok (error.status, &error);
  cli_shell ("pinwheel run @/model/m.yaml --method rk4 --step 0.1 --specialise never");
  if (*text == 0) assert_string_equal (cli_err, "");
  if (strstr (cli_err, text) == NULL) print_error ("told:\n%s\nexpected:\n%s\n", cli_err, text);
  assert_non_null (strstr (cli_err, text));
}

TEST (coverage) {
  table_covers ("{points: [[0, 1], [10, 2]]}", "");
  table_covers ("{points: [[-1, 1], [12, 2]]}", "");
  table_covers (
      "{points: [[0, 1], [3, 2]]}",
      "pinwheel: torque T: value: the table has times from 0 to 3 s and covers 30 % of the run, which ends at 10 "
      "s: its last value holds for 7 s after\n");
  table_covers (
      "{points: [[2, 1], [6, 2]]}",
      "covers 40 % of the run, which ends at 10 s: its first value holds for 2 s before, its last value for 4 s "
      "after\n");
  table_covers ("{points: [[2, 1], [60, 2]]}",
                "covers 80 % of the run, which ends at 10 s: its first value holds for 2 s");
  table_covers ("{points: [[1700000000, 1], [1700000020, 2]]}",
                "from 1700000000 to 1700000020 s, after the run, which ends at 10 s: its first value holds throughout; "
                "time_offset: -1700000000 lets it begin at 0\n");
  table_covers ("{points: [[1700000000, 1], [1700000020, 2]], time_offset: -1.7e9}", "");
  table_covers ("{points: [[-9, 1], [-1, 2]]}", "from -9 to -1 s, before the run: its last value holds throughout\n");
  table_covers ("{points: [[0, 1], [12000, 2]]}", "uses 0.083 %: if they are in ms, add time_scale: 1e-3\n");
  table_covers ("{points: [[0, 1], [12000, 2]], time_scale: 1e-3}", "");
  cli_write ("model/data.csv", "0,1\n1,\n4,2\n,\n10,3\n");
  table_covers ("{file: data.csv}", "pinwheel: torque T: value: 2 rows with empty cells are left out of the table\n");
  cli_shell ("pinwheel check @/model/m.yaml");
  assert_non_null (strstr (cli_out, "torque T: value: 2 rows with empty cells are left out of the table"));
  static const char *const command[] = {
    "sweep @/model/m.yaml --vary a.x=1,2 -t 20 --step 0.1 -o @/s.csv", "compare @/model/m.yaml --methods rk4 -t 20",
    "sensitivity @/model/m.yaml --of a.phi --by a.omega -t 20 --step 0.1",
    "optimise @/model/m.yaml --maximise a.phi --free a.omega=0:1 -t 20 --step 0.1"
  };
  for (size_t i = 0; i < sizeof command / sizeof *command; i++) {
    cli_shell (check_text ("pinwheel %s", command[i]));
    const char *said =
        strstr (cli_err, "covers 50 % of the run, which ends at 20 s: its last value holds for 10 s after");
    assert_non_null (said);
    assert_null (strstr (said + 1, "covers"));
  }
}

/* Nothing outside the model's folder is read, however it is named. */
TEST (places) {
  char outside[200];
  cli_write ("data.csv", "0,1\n1,2\n");
  snprintf (outside, sizeof outside, "{file: %s/data.csv}", cli_folder);
#define OWN "a file must be in the model's folder: its path is relative and has no \"..\""
#define LINK "it is a link that leads out of the model's folder"
  table_bad (outside, OWN);
  table_bad ("{file: ../data.csv}", OWN);
  table_bad ("{file: sub/../../data.csv}", OWN);
  table_bad ("{file: ..}", OWN);
  assert_int_equal (symlink ("../data.csv", cli_path ("model/link.csv")), 0);
  table_bad ("{file: link.csv}", LINK);
  assert_int_equal (symlink ("..", cli_path ("model/up")), 0);
  table_bad ("{file: up/data.csv}", LINK);
  assert_int_equal (mkdir (cli_path ("model-b"), 0700), 0); /* its name begins like that of the model's folder */
  cli_write ("model-b/data.csv", "0,1\n1,2\n");
  assert_int_equal (symlink ("../model-b/data.csv", cli_path ("model/b.csv")), 0);
  table_bad ("{file: b.csv}", LINK);
  assert_int_equal (mkfifo (cli_path ("model/pipe.csv"), 0600), 0);
  table_bad ("{file: pipe.csv}", "it is a FIFO or pipe, not a regular file");
  table_bad ("{file: sub}", "it is a directory, not a regular file");
  table_bad ("{file: none.csv}", "cannot read \"none.csv\": No such file or directory");
  assert_int_equal (symlink ("data.csv", cli_path ("model/good.csv")), 0);
  assert_int_equal (symlink ("../data.csv", cli_path ("model/sub/good.csv")), 0);
  table_good ("0,1\n0.5,-2\n2,3e-1\n", "{file: good.csv}");
  table_good ("0,1\n0.5,-2\n2,3e-1\n", "{file: sub/good.csv}");
  table_good ("0,1\n0.5,-2\n2,3e-1\n", "{file: sub/..data.csv}");
}

TEST (limits) {
  char message[200];
  cli_write ("model/large.csv", "0,1\n");
  assert_int_equal (truncate (cli_path ("model/large.csv"), (256L << 20) + 1), 0);
  table_bad ("{file: large.csv}", "large.csv: the file has more than 256 MB, the limit for a table");
  FILE *f = fopen (cli_path ("model/long.csv"), "w");
  assert_non_null (f);
  for (int i = 0; i < 4000001; i++) fputs ("1\n", f);
  assert_int_equal (fflush (f), 0);
  snprintf (message, sizeof message, "long.csv:1: more than %d lines", 4000000);
  table_bad ("{file: long.csv}", message);
  assert_int_equal (ftruncate (fileno (f), 2000000), 0);
  assert_int_equal (fclose (f), 0);
  table_bad ("{file: long.csv}", "long.csv:1: there is no column 2: the line has 1 cell");
}

/* A page has a table once, although two signals read it, takes no definition for a table, and contains the text that
 * was loaded even if the file has changed since. */
TEST (page) {
  static const char text[] =
      "pinwheel: 1\nlet: {file: 3}\nbodies: [{name: a, mass: file, inertia: 1}]\n"
      "elements: [{force: F, body: a, fx: {table: {file: t.csv}}, fy: {table: {file: t.csv}}}]\n";
  pw_error error = { 0 };
  pw_page page;
  int tables = 0, texts = 0;
  cli_write ("model/m.yaml", text);
  cli_write ("model/t.csv", "0,1\n1,2\n");
  pw_file *f = pw_file_open (cli_path ("model/m.yaml"), &error);
  check_ok (f ? PW_OK : error.status, &error);
  cli_write ("model/m.yaml", "");
  int status = pw_page_open (&page, f, &error);
  for (int i = 0; i < page.files; i++) {
    const pw_page_file *part = &page.file[i];
    tables += strcmp (part->name, "t.csv") == 0;
    texts +=
        strcmp (part->name, "model") == 0 && part->size == strlen (text) && memcmp (part->bytes, text, part->size) == 0;
  }
  pw_page_close (&page);
  pw_file_close (f);
  if (status != PW_OK && strstr (error.text, "without the engine")) skip ();
  check_ok (status, &error);
  assert_true (tables == 1 && texts == 1);
  const char named[] = "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\n"
                       "elements: [{force: F, body: a, fx: {table: {file: tree}}}]\n";
  cli_write ("model/m.yaml", named);
  cli_write ("model/tree", "0,1\n1,2\n");
  f = pw_file_open (cli_path ("model/m.yaml"), &error);
  assert_int_equal (pw_page_open (&page, f, &error), PW_INPUT);
  assert_string_equal (error.text, "table tree: a page has a part of this name; rename the file, to tree.csv");
  pw_page_close (&page);
  pw_file_close (f);
}

static int table_setup (void) {
  if (cli_setup () != 0 || mkdir (cli_path ("model"), 0700) != 0) return -1;
  return mkdir (cli_path ("model/sub"), 0700) == 0 ? symlink ("../data.csv", cli_path ("model/sub/..data.csv")) : -1;
}

const check_fixture fixture = { table_setup, cli_teardown };
