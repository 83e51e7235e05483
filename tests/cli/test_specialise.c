/* --specialise: compiled code of scenes, with and without a cache and a compiler. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"
#include "specialise_agree.h"

#define RUN "pinwheel run chaplygin-sleigh -t 0.1 --specialise always "

/* A compiler that counts its calls in @/calls, and a cache that is empty. */
#define FRESH                                                                                               \
  "rm -rf @/c @/calls @/tmp; mkdir @/tmp; printf '#!/bin/sh\\necho call >>@/calls\\nexec cc $*\\n' >@/cc\n" \
  "chmod +x @/cc; export CC=@/cc XDG_CACHE_HOME=@/c TMPDIR=@/tmp\n"
#define CACHED "export CC=@/cc XDG_CACHE_HOME=@/c TMPDIR=@/tmp\n"
#define CALLS "if [ -e @/calls ]; then wc -l <@/calls; else echo 0; fi\n"

static void specialise_says (const char *engine) {
  if (strstr (cli_out, engine) == NULL) print_error ("%s\nexpected %s\n", cli_out, engine);
  assert_non_null (strstr (cli_out, engine));
}

/* ---- The cache ---- */

/* Compiled once, then loaded; nothing but the object remains, and it is private. */
TEST (cached) {
  cli_good (FRESH RUN
            "--json @/1.json >@/1\n" RUN "--json @/2.json >@/2\n" CALLS
            "stat -c %a @/c/pinwheel; ls @/c/pinwheel | sed 's/.*[.]//'; ls @/tmp; grep -v cpu_s @/1.json >@/a\n"
            "grep -v cpu_s @/2.json | cmp @/a -");
  assert_string_equal (cli_out, "1\n700\nso\n");
  assert_true (cli_says (cli_file ("2.json"), "engine", "specialised"));
  assert_true (cli_number (cli_file ("2.json"), "statistics", "specialised", NULL) > 300);
}

/* A compiler that has changed makes a new object; it is found in the current folder if PATH has an empty entry. */
TEST (changed_compiler) {
  cli_good (FRESH "mv @/cc @/counting; export CC=counting PATH=:$PATH p=$(realpath ${PINWHEEL:-build/pinwheel}); cd @\n"
                  "pinwheel () { $p $*; }\n" RUN ">/dev/null; echo >>counting\n" RUN ">/dev/null; " CALLS);
  assert_string_equal (cli_out, "2\n");
}

/* An object that is not what was written is replaced; the run has its code all the same. */
TEST (damaged) {
  static const char *const damage[] = {
    "s=$(wc -c <$f); head -c $((s / 2)) $f >@/x; cat @/x >$f",
    "printf X | dd of=$f bs=1 seek=5000 conv=notrunc 2>/dev/null",
    ": >$f",
    "echo 'int x;' >$f",
    "s=$(wc -c <$f); head -c 1000000 /dev/zero | head -c $s >$f",
  };
  cli_good (FRESH RUN ">/dev/null");
  for (size_t i = 0; i < sizeof damage / sizeof *damage; i++) {
    cli_shell (check_text (CACHED "f=$(echo @/c/pinwheel/*.so); %s\n" RUN, damage[i]));
    specialise_says ("code specialised for this scene");
    assert_non_null (strstr (cli_err, ".so is replaced: it is damaged\n"));
    assert_ptr_equal (strchr (cli_err, '\n'), cli_err + strlen (cli_err) - 1);
    cli_good (CACHED RUN);
  }
}

/* Objects under names of others are never used. */
TEST (foreign_object) {
  cli_good (FRESH RUN ">/dev/null; f=$(echo @/c/pinwheel/*.so); cp $f @/one\n"
                      "pinwheel run snakeboard -t 0.1 --specialise always >/dev/null\n"
                      "for g in @/c/pinwheel/*.so; do [ $g = $f ] || cp $g $f; done; cmp -s $f @/one && exit 9\n" RUN
                      "| grep specialised; cmp $f @/one && " CALLS);
  assert_string_equal (strchr (cli_out, '\n') + 1, "3\n");
}

/* A cache to which others can write, or that is no folder, is left alone; without one the code is made apart. */
TEST (unusable) {
  static const struct {
    const char *make, *notice;
  } cache[] = {
    { "mkdir -p @/c/pinwheel; chmod 777 @/c/pinwheel", "@/c/pinwheel is not used: others can write to it" },
    { "mkdir -p @/c/pinwheel; chmod 770 @/c/pinwheel", "@/c/pinwheel is not used: others can write to it" },
    { "mkdir -p @/c; chmod 777 @/c", "@/c is not used: others can write to it" },
    { "mkdir @/c @/elsewhere; ln -s @/elsewhere @/c/pinwheel", "@/c/pinwheel is not used: it is not a folder" },
    { "mkdir @/c; : >@/c/pinwheel", "@/c/pinwheel is not used: it is not a folder" },
    { "mkdir -p @/c/pinwheel; chown 12345 @/c/pinwheel", "@/c/pinwheel is not used: it belongs to another user" },
    { "export XDG_CACHE_HOME=/proc/none", "/proc/none is not used: No such file or directory" }
  };
  for (size_t i = 0; i < sizeof cache / sizeof *cache; i++) {
    char command[900], notice[300], expected[600];
    if (strstr (cache[i].make, "chown") && geteuid () != 0) continue;
    snprintf (command, sizeof command,
              FRESH "%s\n" RUN "&& ls @/tmp; ls -A @/c/pinwheel 2>/dev/null | grep so; rm -rf @/elsewhere",
              cache[i].make);
    snprintf (notice, sizeof notice, "pinwheel: the cache %s\n", cache[i].notice);
    cli_expand (notice, expected, sizeof expected);
    cli_shell (command);
    specialise_says ("code specialised for this scene");
    assert_null (strstr (cli_out, ".so"));
    assert_null (strstr (cli_out, "pinwheel-"));
    assert_string_equal (cli_err, expected);
  }
  cli_good (FRESH "unset HOME XDG_CACHE_HOME\n" RUN "| grep -c specialised; ls @/tmp");
  assert_string_equal (cli_out, "1\n");
}

/* The folder may go at any time, even while the compiler runs. */
TEST (deleted) {
  cli_good (FRESH "printf '#!/bin/sh\\nrm -rf @/c/pinwheel\\nexec cc $*\\n' >@/cc\n" RUN
                  "| grep -c specialised; ls @/tmp; ls @/c");
  assert_string_equal (cli_out, "1\n");
}

/* Processes that need the same code wait for the first one. */
TEST (concurrent) {
  cli_good (FRESH
            "printf '#!/bin/sh\\necho call >>@/calls\\nsleep 0.3\\nexec cc $*\\n' >@/cc\n"
            "for i in 1 2 3 4 5; do " RUN "-o @/$i.csv --json @/$i & done; wait\n"
            "cat @/[1-5] | grep -c 'engine\": \"specialised'; for i in 2 3 4 5; do cmp @/1.csv @/$i.csv; done\n" CALLS
            "ls @/c/pinwheel | wc -l");
  assert_string_equal (cli_out, "5\n1\n1\n");
}

/* A killed compilation neither blocks nor damages the next one, though its compiler may still run. */
TEST (killed) {
  cli_good (
      FRESH
      "printf '#!/bin/sh\\necho call >>@/calls\\n[ -e @/go ] || { : >@/on; sleep 0.6; }\\nexec cc $*\\n' >@/cc\n"
      "rm -f @/go @/on; ${PINWHEEL:-build/pinwheel} run chaplygin-sleigh -t 0.1 --specialise always >/dev/null 2>&1 &\n"
      "while kill -0 $! 2>/dev/null && [ ! -e @/on ]; do sleep 0.02; done; kill -9 $!; wait $! 2>/dev/null; : "
      ">@/go\n" RUN "| grep -c specialised; sleep 1; " RUN "| grep -c specialised; " CALLS
      "ls @/c/pinwheel/*.c 2>/dev/null || :");
  assert_string_equal (cli_out, "1\n1\n2\n");
}

/* The oldest files go. */
TEST (size) {
  cli_good (FRESH "mkdir -p -m 700 @/c @/c/pinwheel; for i in 1 2 3; do truncate -s 30M @/c/pinwheel/$i.so\n"
                  "touch -d \"$((4 - i)) days ago\" @/c/pinwheel/$i.so; done\n" RUN
                  ">/dev/null; cd @/c/pinwheel; ls ?.so; ls | wc -l");
  assert_string_equal (cli_out, "2.so\n3.so\n3\n");
}

/* ---- Without a compiler ---- */

TEST (no_compiler) {
  cli_good (FRESH "pinwheel run chaplygin-sleigh -t 0.1 --specialise never -o @/never.csv >/dev/null");
  cli_shell (FRESH "export CC=/nonexistent\n" RUN "-o @/none.csv --json @/none.json; cmp @/never.csv @/none.csv");
  assert_string_equal (
      cli_err, "pinwheel: general engine: cannot run the C compiler \"/nonexistent\" that specialised code "
               "needs (No such file or directory): install one, or name another in the environment variable CC\n");
  assert_true (cli_says (cli_file ("none.json"), "engine", "general"));
  assert_true (cli_says (cli_file ("none.json"), "engine_reason", "no C compiler or no pinwheel.h"));
}

/* A program without its headers, in which a text model runs. */
TEST (no_header) {
  cli_write ("one.yaml",
             "pinwheel: 1\nbodies: [{name: a, mass: 1, inertia: 1}]\nelements: [{force: F, body: a, fx: 1}]\n");
  assert_int_equal (
      cli_run (FRESH "mkdir @/bin && cp \"${PINWHEEL:-build/pinwheel}\" ${BUILD:-build}/libpinwheel*.so.* @/bin\n"
                     "@/bin/pinwheel run @/one.yaml -t 0.1 --specialise always --json @/bare.json"),
      0);
  assert_non_null (strstr (cli_err, "pinwheel.h is not in "));
  assert_true (cli_says (cli_file ("bare.json"), "engine_reason", "no C compiler or no pinwheel.h"));
}

/* What does not compile is kept, with the messages; the run goes on. */
TEST (bad_compiler) {
  cli_shell (FRESH "printf '#!/bin/sh\\necho message >&2; exit 1\\n' >@/cc\n" RUN
                   "&& head -c 3 @/c/pinwheel/*.c && cat @/c/pinwheel/*.log");
  specialise_says ("general engine: the generated code does not compile\n");
  specialise_says ("/* message\n");
  assert_non_null (strstr (cli_err, "pinwheel: general engine: "));
  assert_non_null (strstr (cli_err, ".c does not compile; the messages of "));
  assert_ptr_equal (strchr (cli_err, '\n'), cli_err + strlen (cli_err) - 1);
  cli_shell (CACHED "export CC=cc\n" RUN "; rm -rf @/c; unset HOME XDG_CACHE_HOME; export CC=false\n" RUN
                    "; ls @/tmp/*/*.c | wc -l");
  specialise_says ("general engine: the generated code does not compile\n1\n");
}

/* A compiler that is killed says nothing about the code, which is not kept. */
TEST (killed_compiler) {
  cli_shell (FRESH "printf '#!/bin/sh\\nkill -9 $$\\n' >@/cc\n" RUN "&& ls @/c/pinwheel @/tmp");
  specialise_says ("general engine: the generated code cannot be compiled or loaded\n");
  assert_null (strstr (cli_out, ".c\n"));
  assert_non_null (strstr (cli_err, "/cc\" was ended by a signal: Killed\n"));
  cli_bad ("CC=@/cc pinwheel show models/vehicles/ezyroller.c", 1,
           "the C compiler \"@/cc\" was ended by a signal: Killed");
}

/* Neither does a compiler that writes something else, or nothing, stop a run; and its object is not kept. */
TEST (strange_compiler) {
  static const struct {
    const char *does, *notice;
  } strange[] = {
    { "while [ \"$1\" != -o ]; do shift; done; echo rubbish >$2", "it cannot be loaded: " },
    { "exit 0", "the compiler has written no object\n" },
    { "while [ \"$1\" != -o ]; do shift; done; echo \"int pw_specialised_scene[9];\" | cc -shared -xc - -o $2",
      "it belongs to another scene or version\n" }
  };
  for (int i = 0; i < 3; i++) {
    cli_shell (
        check_text (FRESH "cat >@/cc <<'X'\n#!/bin/sh\n%s\nX\n" RUN "&& ls @/c/pinwheel @/tmp", strange[i].does));
    specialise_says ("general engine: the generated code cannot be compiled or loaded\n");
    assert_null (strstr (cli_out, ".so\n"));
    assert_non_null (strstr (cli_err, strange[i].notice));
  }
}

/* ---- When code is used ---- */

TEST (when) {
  for (int cached = 0; cached < 2; cached++) { /* the same with the object in the cache */
    cli_good (cached ? CACHED "rm @/calls" : FRESH);
    cli_good (CACHED "pinwheel run chaplygin-sleigh -t 1 --step 1e-3 | grep -c 'general engine: short run'\n" CALLS
                     "pinwheel run chaplygin-sleigh -t 9 --step 1e-5 | grep -c 'general engine: short run'\n" CALLS
                     "pinwheel run chaplygin-sleigh -t 11 --step 1e-5 --specialise never | grep -c 'engine: "
                     "--specialise never'\n" CALLS
                     "pinwheel run chaplygin-sleigh -t 11 --step 1e-5 | grep -c specialised\n" CALLS);
    assert_string_equal (cli_out, cached ? "1\n0\n1\n0\n1\n0\n1\n0\n" : "1\n0\n1\n0\n1\n0\n1\n1\n");
  }
  cli_bad ("pinwheel run pendulum --specialise allways", 2,
           "--specialise \"allways\": expected auto, always or never; did you mean \"always\"?");
  cli_bad ("pinwheel sweep --merge a b -o @/x.csv --specialise always", 2,
           "--specialise cannot be combined with --merge: the parts define the sweep");
}

/* Scenes without code run in the general engine: `always` says so, `auto` does not. */
TEST (not_possible) {
  cli_good (
      FRESH
      "pinwheel run chain --set n=40 -t 0.1 --step 1e-7 --limit 0.05 >/dev/null 2>&1; pinwheel run chain --set n=40 -t "
      "0.01 | grep general; " CALLS);
  assert_string_equal (cli_out, "  general engine: short run\n0\n");
  cli_shell (FRESH "pinwheel run chain --set n=40 -t 0.01 --specialise always | grep general; " CALLS);
  assert_string_equal (cli_out, "  general engine: 80 constraint equations: specialised code has at most 60\n0\n");
  assert_string_equal (
      cli_err, "pinwheel: general engine: model chain: 80 constraint equations: specialised code has at most 60\n");
  cli_shell (FRESH "pinwheel run chaplygin-sleigh -t 0.01 --specialise always -m ida+none | grep general");
  assert_string_equal (
      cli_out, "  general engine: the method, its options or redundant drives do not permit specialised code\n");
}

/* A study uses one engine, and says which. */
TEST (studies) {
  cli_good (
      FRESH
      "pinwheel compare chaplygin-sleigh -m rk4+projection --step-ladder 0.1 -t 1 --repeats 1 --specialise always "
      "| grep -c '^all runs use code specialised'\n"
      "pinwheel compare chaplygin-sleigh -m rk4+projection --step-ladder 0.1 -t 1 --repeats 1 --specialise never "
      "| grep -c '^all runs use the general engine: --specialise never'\n"
      "pinwheel drift chaplygin-sleigh -m rk4+projection --only-methods -t 1 --specialise always "
      "| grep -c '^all runs use code specialised'\n" CALLS);
  assert_string_equal (cli_out, "1\n1\n1\n1\n");
}

/* ---- Sweeps ---- */

/* The structure depends on n; rows are the same for any number of workers, in parts, and without a cache. */
TEST (sweep) {
  cli_good (
      FRESH
      "s='pinwheel sweep n-trailer --vary n=1,2,3 --vary L=0.5,0.6 -t 0.5 --specialise always'\n"
      "for j in 1 2 4; do $s -j $j -o @/s$j.csv || exit 1; done; cmp @/s1.csv @/s2.csv; cmp @/s1.csv @/s4.csv\n" CALLS
      "for p in 1 2; do $s --part $p/2 -o @/p$p.csv || exit 1; done\n"
      "pinwheel sweep --merge @/p1.csv @/p2.csv -o @/m.csv; cmp @/s1.csv @/m.csv\n"
      "unset HOME XDG_CACHE_HOME; $s -j 2 -o @/none.csv; cmp @/s1.csv @/none.csv; ls @/tmp\n" CALLS
      "pinwheel sweep n-trailer --vary n=1,2,3 --vary L=0.5,0.6 -t 0.5 -o @/never.csv; cmp -s @/s1.csv @/never.csv || "
      "echo other");
  assert_string_equal (cli_out, "3\n6\nother\n");
}

/* A sweep that was killed, with its cache deleted meanwhile, ends with the same bytes. */
TEST (sweep_killed) {
  cli_good (FRESH "s='sweep n-trailer --vary n=1,2 --vary L=0.5:0.6:40 -t 2 --specialise always -j 2'\n"
                  "pinwheel $s -o @/whole.csv || exit 1\n"
                  "${PINWHEEL:-build/pinwheel} $s -o @/k.csv >/dev/null 2>&1 &\n"
                  "while kill -0 $! && [ $(cat @/k.csv.part | grep -c ,ok,) -lt 5 ]; do sleep 0.01; done 2>/dev/null\n"
                  "kill -9 $! 2>/dev/null; wait $! 2>/dev/null; [ -e @/k.csv ] && echo complete; rm -rf @/c\n"
                  "pinwheel $s -o @/k.csv 2>@/said; grep -c 'continuing with' @/said; cmp @/whole.csv @/k.csv");
  assert_string_equal (cli_out, "1\n");
}

/* Rows of different engines are not mixed. */
TEST (sweep_engine) {
  cli_good (FRESH
            "s='pinwheel sweep n-trailer --vary L=0.5,0.6 -t 0.5'; $s --part 1/2 -o @/p1.csv --specialise always\n"
            "$s --part 2/2 -o @/p2.csv --specialise never; pinwheel sweep --merge @/p1.csv @/p2.csv -o @/m.csv "
            "2>@/said; echo $?\n"
            "grep -c 'engine is' @/said");
  assert_string_equal (cli_out, "2\n1\n");
}

/* ---- Results ---- */

/* A few models; slow_specialise has all. */
TEST (gallery) {
  static const char *const model[] = { "ezyroller", "car-tyres", "elliptic-wire", "slider-crank", "n-four-bar" };
  for (size_t i = 0; i < sizeof model / sizeof *model; i++) specialise_agree (model[i]);
}

/* ---- The text ---- */

/* The name of the scene does not appear in the text; those of bodies and elements cannot end a comment. */
TEST (names) {
  static const char *const name[] = { "*/ int x; /*", "\\n#include <y>",    "x\\",
                                      "?\?/",         "gr\xC3\xBC\xC3\x9F", "a\" \"%s%n" };
  pw_error error = { 0 };
  pw_file *f = pw_file_open ("pendulum", &error);
  for (size_t i = 0; i < sizeof name / sizeof *name; i++) {
    pw_model *m = pw_model_new (name[i], pw_file_table (f), &error);
    check_ok (m ? pw_model_build (m, &error) : error.status, &error);
    pw_system *s = pw_system_compile (m, &error);
    char *text = pw_system_source (s, NULL, &error);
    assert_non_null (text);
    assert_null (strstr (text, name[i]));
    const char *first = strstr (text, "*/\n");
    assert_true (first && strcspn (text, "\n") == (size_t)(first - text) + 2);
    for (const char *c = text; *c; c++) assert_true ((*c >= ' ' && *c <= '~') || *c == '\n' || *c == '\t');
    cli_write ("names.c", text);
    cli_good ("cc -std=c11 -Wall -Wno-unused -Werror -I${BUILD:-build}/include -c @/names.c -o @/names.o");
    free (text);
    pw_system_free (s);
    pw_model_free (m);
  }
  pw_file_close (f);
  cli_good (
      FRESH
      "cp models/linkages/pendulum.yaml '@/*\\ #\"$(kill $$)`kill $$`;&.yaml'\n"
      "pinwheel run '@/*\\ #\"$(kill $$)`kill $$`;&.yaml' -t 0.01 --specialise always | grep -c 'code specialised'");
  assert_string_equal (cli_out, "1\n");
}

/* The text is that of the model with its parameters. */
TEST (show) {
  cli_good ("pinwheel show n-trailer --set n=3 --c >@/3.c; pinwheel show n-trailer --c >@/2.c\n"
            "grep -c 'body 3: trailer3 ' @/3.c; grep -c 'body 3' @/2.c; cc -std=c11 -Wall -Wno-unused -Werror -O0 "
            "-I${BUILD:-build}/include -c @/3.c -o @/3.o");
  assert_string_equal (cli_out, "1\n0\n");
  cli_bad ("pinwheel show chain --set n=40 --c", 2,
           "model chain: 80 constraint equations: specialised code has at most 60");
}

const check_fixture fixture = { cli_setup, cli_teardown };
