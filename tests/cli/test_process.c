/* The process of the program: its environment and the signals that it ignores; and the time limit of test programs. */
#define _GNU_SOURCE /* program_invocation_name */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"

TEST (ignored) {
  cli_good ("POSIXLY_CORRECT=1 pinwheel run ezyroller -t 0.01 -o - | wc -l");
  assert_string_equal (cli_out, "12\n");
  cli_run (
      "trap '' INT TERM; \"${PINWHEEL:-build/pinwheel}\" run ezyroller -t 1e6 --every 0.01 -o @/i.csv 2>@/log & p=$!\n"
      "while kill -0 $! 2>/dev/null && [ ! -s @/i.csv.part ]; do sleep 0.01; done; kill -INT $p; kill -TERM $p; "
      "size=$(wc -c <@/i.csv.part)\n"
      "while kill -0 $p && [ $(wc -c <@/i.csv.part) -lt $((size + 100000)) ]; do sleep 0.01; done\n"
      "kill -KILL $p; wait $p; echo $?"); /* it has gone on writing */
  assert_string_equal (cli_out, "137\n");
}

/* A signal before the first step, here during a compilation, is reported, too. */
TEST (compiling) {
  cli_good ("printf '#!/bin/sh\\n: >@/begun\\nexec sleep 2\\n' >@/cc; chmod +x @/cc");
  int status = cli_run (
      "CC=@/cc XDG_CACHE_HOME=@/cache \"${PINWHEEL:-build/pinwheel}\" drift ezyroller --specialise always & p=$!\n"
      "while kill -0 $p 2>/dev/null && [ ! -e @/begun ]; do sleep 0.01; done; kill -TERM $p; wait $p");
  assert_int_equal (status, 130);
  assert_string_equal (cli_err, "pinwheel: interrupted\n");
}

/* A test program that takes too long ends its children, says its name and fails (limit.c). */
TEST (limit) {
  assert_int_not_equal (cli_run (check_text ("LIMIT=1 %s @/child", program_invocation_name)), 0);
  assert_non_null (strstr (cli_out, "[  FAILED  ] test_process: takes longer than its time limit\n"));
  cli_good ("n=0; while kill -0 $(cat @/child) 2>/dev/null && [ $n -lt 100 ]; do n=$((n + 1)); sleep 0.05; done; "
            "[ $n -lt 100 ]");
}

const check_fixture fixture = { cli_setup, cli_teardown };

int main (int argc, char **argv) {
  if (argc > 1) return setenv ("CHILD", argv[1], 1) || system ("echo $$ >\"$CHILD\"; sleep 600");
  return check_run ();
}
