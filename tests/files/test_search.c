/* The search path for models as a program that contains the libraries sees it. */
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"

const check_fixture fixture = { cli_setup, cli_teardown };

/* With an argument, looks for a model of this name and returns a status. */
int main (int argc, char **argv) {
  pw_error error = { 0 };
  if (argc == 1) return check_run ();
  pw_file_close (pw_file_open (argv[1], &error));
  return -error.status;
}

/* Started by its bare name, the program does not take a file of this name in the working folder for itself. */
TEST (bare_name) {
  cli_good ("mkdir -p @/bin @/work/models && cp /proc/$PPID/exe @/bin/finder && touch @/work/finder\n"
            "cp ${BUILD:-build}/models/ezyroller.so @/work/models/other.so\n"
            "cd @/work && { PINWHEEL_MODELS= PATH=@/bin:$PATH finder other; test $? = 2; }");
  cli_good ("cd @/work && PINWHEEL_MODELS=@/work/models PATH=@/bin:$PATH finder other");
}

/* A folder whose path, links resolved, ends like ":" and the path of another one does not hide that one. */
TEST (colon) {
  cli_good ("d=$(cd @ && pwd -P); mkdir -p $d/m $d/a:$d/m && ln -s $d/a:$d/m $d/link\n"
            "cp ${BUILD:-build}/models/ezyroller.so $d/m/other.so\n"
            "PINWHEEL_MODELS=$d/link:$d/m pinwheel run other --t-end 0.1");
}
