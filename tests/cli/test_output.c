/* Files that a command writes: each by one process and for one use, complete or under a temporary name, wherever their
 * names lead; and files of the wrong type that it is asked to read. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"

/* ---- One use of each file ---- */

TEST (uses) {
  cli_good ("mkdir -p @/u/D && cd @/u && cp $OLDPWD/tests/models/signals.yaml m.yaml && : >none");
  cli_good ("cp models/vehicles/car.yaml @/u/car.yaml; printf 't,M\\n0,1\\n1,2\\n' >@/u/M.csv");
  cli_write ("u/table.yaml", "pinwheel: 1\nbodies:\n  - {name: a, mass: 1, inertia: 1}\nelements:\n"
                             "  - {torque: T, body: [a, ground], value: {table: {file: M.csv, columns: [t, M]}}}\n");
  cli_good (
      "cd @/u; ln -s car.yaml link.yaml; ln car.yaml hard.csv; ln -s new.csv soft.csv; cat *.yaml M.csv >../before");
  const cli_wrong each[] = {
    { "run ezyroller -o o.csv --json ./o.csv", "-o and --json cannot both write to ./o.csv" },
    { "run ezyroller -o new.csv --json soft.csv", "-o and --json cannot both write to soft.csv" },
    { "run ezyroller -o o.csv --json D/../o.csv.part", "-o and --json cannot both write to D/../o.csv.part" },
    { "run ezyroller -o o.csv --json o.csv.part.old", "-o and --json cannot both write to o.csv.part.old" },
    { "run ezyroller -o - --json /dev/stdout", "-o and --json cannot both write to /dev/stdout" },
    { "run ezyroller -o a.html --animate ./a.html", "-o and --animate cannot both write to ./a.html" },
    { "run ezyroller -o c --checkpoint ./c", "--checkpoint and -o cannot both write to c" },
    { "run ./car.yaml -o car.yaml", "-o car.yaml would overwrite the model, @/u/car.yaml" },
    { "run ./link.yaml --json car.yaml", "--json car.yaml would overwrite the model, @/u/car.yaml" },
    { "run ./car.yaml --checkpoint hard.csv", "--checkpoint hard.csv would overwrite the model, @/u/car.yaml" },
    { "run ./table.yaml -o M.csv", "-o M.csv would overwrite a file of the model, @/u/M.csv" },
    { "run ./table.yaml --json ./M.csv", "--json ./M.csv would overwrite a file of the model, @/u/M.csv" },
    { "run ezyroller -o M.csv --reference ./M.csv", "-o M.csv would overwrite --reference, ./M.csv" },
    { "run ezyroller --plots D --json D/energy.dat", "--plots D would overwrite --json, D/energy.dat" },
    { "run ezyroller --plots D --json D/energy.dat.part", "--plots D would overwrite --json, D/energy.dat.part" },
    { "compare ezyroller --plots D --reference D/compare.csv", "--plots D would overwrite --reference, D/compare.csv" },
    { "sweep ./car.yaml --vary m=1,2 -o car.yaml", "-o car.yaml would overwrite the model, @/u/car.yaml" },
    { "sweep ./table.yaml --vary a.x=1,2 -o M.csv", "-o M.csv would overwrite a file of the model, @/u/M.csv" },
    { "sweep --merge M.csv -o ./M.csv", "-o ./M.csv would overwrite the part, M.csv" },
    { "check ./car.yaml --json car.yaml", "--json car.yaml would overwrite the model, @/u/car.yaml" },
  };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++) {
    cli_bad (
        check_text (
            "p=$PWD/; case $PINWHEEL in /*) p= ;; esac; p=$p${PINWHEEL:-build/pinwheel}; cd @/u; : >D/compare.csv; "
            "\"$p\" %s",
            each[i].arguments),
        2, each[i].message);
    cli_good ("cd @/u; cat *.yaml M.csv | cmp - ../before; ls | grep -c 'part$\\|^o.csv\\|^new\\|^c$' || true");
    assert_string_equal (cli_out, "0\n");
  }
  cli_good ("pinwheel run ezyroller -t 0.01 -o /dev/null --json /dev/null"); /* it takes everything */
}

/* The value "file" of an element is no table. */
TEST (named_file) {
  cli_write ("named.yaml", "pinwheel: 1\nbodies: [{name: bob, mass: 1, inertia: 1}]\n"
                           "elements: [{pin: file, body: [bob, ground], at: [[0, 0], [0, 0]]}]\n");
  cli_good ("p=$(realpath ${PINWHEEL:-build/pinwheel}); cd @; \"$p\" run ./named.yaml -t 0.1 -o body");
}

/* ---- Links ---- */

TEST (links) {
  cli_good (
      "mkdir -p @/k; cd @/k; mkdir sub; echo mine >mine; for f in a.csv a.json a.ck t.csv; do ln -s mine $f.part; "
      "done; "
      "ln -s mine t.csv.sorted; ln -s mine motion.dat.part; ln -s sub/there.csv far.csv; echo old >sub/there.csv; "
      "ln -s sub/absent.csv none.csv");
#define OUTPUT_LINK ": its temporary name is a symbolic link"
  cli_bad ("pinwheel run ezyroller -t 1 -o @/k/a.csv", 1, "cannot write @/k/a.csv" OUTPUT_LINK);
  cli_bad ("pinwheel run ezyroller -t 1 --json @/k/a.json", 1, "cannot write @/k/a.json" OUTPUT_LINK);
  cli_bad ("pinwheel run ezyroller -t 1 --checkpoint @/k/a.ck", 1, "cannot write @/k/a.ck" OUTPUT_LINK);
  cli_bad ("pinwheel run ezyroller -t 1 --plots @/k", 1, "cannot write @/k/motion.dat" OUTPUT_LINK);
  cli_bad ("pinwheel sweep ezyroller -t 1 --vary a=0.5,0.6 -o @/k/t.csv", 1, "cannot write @/k/t.csv.part" OUTPUT_LINK);
  cli_good ("rm @/k/t.csv.part; mkfifo @/k/t.csv.part");
  cli_bad ("pinwheel sweep ezyroller -t 1 --vary a=0.5,0.6 -o @/k/t.csv", 1,
           "cannot write @/k/t.csv.part: its temporary name is not that of a regular file");
  cli_good ("rm @/k/t.csv.part");
  assert_int_equal (cli_run ("pinwheel sweep ezyroller -t 0.1 --vary a=0.5,0.6 -o @/k/t.csv"), 1);
  assert_non_null (strstr (cli_err, "t.csv" OUTPUT_LINK));
  assert_string_equal (cli_file ("k/mine"), "mine\n");
  cli_good ("pinwheel run ezyroller -t 0.01 -o @/k/far.csv; pinwheel run ezyroller -t 0.01 -o @/k/none.csv; cd @/k; "
            "[ -L far.csv ] && [ -L none.csv ] && wc -l <sub/there.csv && wc -l <sub/absent.csv");
  assert_string_equal (cli_out, "12\n12\n");
  cli_good ("ln -s round @/k/round");
  cli_bad ("pinwheel run ezyroller -t 1 -o @/k/round", 1, "cannot write @/k/round: Too many levels of symbolic links");
}

/* ---- One process ---- */

/* Locks a file or folder as another process would. */
static int output_lock (const char *name, int flags) {
  int file = open (cli_path (name), flags, 0666);
  assert_true (file >= 0 && flock (file, LOCK_EX | LOCK_NB) == 0);
  return file;
}

static void output_locked (const char *lock, int flags, const char *command, const char *message) {
  cli_good ("rm -rf @/l; mkdir -p @/l/D");
  int file = output_lock (lock, flags);
  cli_bad (command, 1, message);
  cli_good ("ls -A @/l/D");
  assert_string_equal (cli_out, "");
  if (flags & O_CREAT) assert_int_equal (write (file, "of a process that was killed\n", 29), 29);
  close (file);
  cli_shell (command);
  cli_good ("ls @/l/*.part 2>/dev/null || true"); /* what it has left is in nobody's way */
  assert_string_equal (cli_out, "");
}

TEST (lock) {
#define OUTPUT_OTHER ": another process is writing it"
  int file = O_RDWR | O_CREAT, folder = O_RDONLY | O_DIRECTORY;
  output_locked ("l/a.csv.part", file, "pinwheel run ezyroller -t 0.1 -o @/l/a.csv",
                 "cannot write @/l/a.csv" OUTPUT_OTHER);
  output_locked ("l/a.json.part", file, "pinwheel run ezyroller -t 0.1 --json @/l/a.json",
                 "cannot write @/l/a.json" OUTPUT_OTHER);
  output_locked ("l/a.html.part", file, "pinwheel run ezyroller -t 0.1 --animate @/l/a.html >@/log",
                 "cannot write @/l/a.html" OUTPUT_OTHER);
  output_locked ("l/a.ck.part", file, "pinwheel run ezyroller -t 0.1 --checkpoint @/l/a.ck >@/log",
                 "cannot write @/l/a.ck" OUTPUT_OTHER);
  output_locked ("l/a.json.part", file, "pinwheel check ezyroller --json @/l/a.json >@/log",
                 "cannot write @/l/a.json" OUTPUT_OTHER);
#define OUTPUT_INTO "cannot write into @/l/D: another process is writing into it"
  output_locked ("l/D", folder, "PATH=/none pinwheel run ezyroller -t 0.1 --plots @/l/D >@/log", OUTPUT_INTO);
  output_locked ("l/D", folder,
                 "PATH=/none pinwheel compare ezyroller -m rk4 -t 0.1 --step-ladder 0.1:0.05 --plots @/l/D >@/log",
                 OUTPUT_INTO);
  output_locked ("l/D", folder,
                 "PATH=/none pinwheel drift ezyroller -m rk4+none --only-methods -t 0.1 --plots @/l/D >@/log",
                 OUTPUT_INTO);
  cli_good ("rm -rf @/l; mkdir @/l");
  int journal = output_lock ("l/s.csv.part", file);
  cli_bad ("pinwheel sweep ezyroller -t 0.1 --vary a=0.5,0.6 -o @/l/s.csv", 1,
           "cannot write @/l/s.csv.part" OUTPUT_OTHER);
  close (journal);
}

/* A run keeps its files locked from its beginning to its end, its checkpoint between two of them. */
TEST (keeps_lock) {
  cli_good ("rm -rf @/l; mkdir @/l");
  cli_run ("\"${PINWHEEL:-build/pinwheel}\" run ezyroller -t 1e6 --every 100 --json @/l/a.json --animate @/l/a.html "
           "--checkpoint @/l/a.ck --checkpoint-every 1 -o @/l/a.csv >@/log 2>&1 & p=$!\n"
           "while kill -0 $! 2>/dev/null && [ ! -e @/l/a.ck ]; do sleep 0.02; done\n"
           "for f in '-o @/l/a.csv' '--json @/l/a.json' '--animate @/l/a.html' '--checkpoint @/l/a.ck'; do\n"
           "  pinwheel run ezyroller -t 0.1 $f; echo $?\ndone; kill -KILL $p");
  assert_string_equal (cli_out, "1\n1\n1\n1\n");
  for (const char *const *n = (const char *const[]){ "a.csv", "a.json", "a.html", "a.ck", NULL }; *n; n++) {
    assert_non_null (strstr (cli_err, check_text ("/l/%s" OUTPUT_OTHER, *n)));
  }
}

/* What a killed process has left under the temporary name is no part of the new file. */
TEST (left_over) {
  cli_good ("pinwheel run pendulum -t 0.1 --every 0.1 -o @/fresh.csv\n"
            "seq 10000 >@/left.csv.part; pinwheel run pendulum -t 0.1 --every 0.1 -o @/left.csv\n"
            "cmp @/left.csv @/fresh.csv");
}

/* A table that ends early, here for a limit on its size, ends with a whole line. */
TEST (whole_lines) {
  assert_int_equal (cli_run ("(ulimit -f 8; pinwheel run pendulum -t 10 --every 0.01 -o @/cut.csv)"), 1);
  cli_good ("tail -c 1 @/cut.csv.part | od -An -c | tr -d ' '; wc -l <@/cut.csv.part");
  assert_memory_equal (cli_out, "\\n\n", 3);
  check_below ("lines", 10, atof (cli_out + 3), "4096 bytes take more than 20 of them");
  assert_int_equal (cli_run ("(ulimit -f 8; pinwheel run pendulum -t 10 --every 0.01 -o @/cut.npz)"), 1);
  assert_non_null (strstr (cli_err, "cut.npz: File too large\n"));
  cli_good ("rm @/cut.csv.part @/cut.npz.part");
}

/* The other files of a run whose table is incomplete are incomplete too, and named. */
TEST (kept) {
  assert_int_equal (
      cli_run ("(ulimit -f 400; pinwheel run ezyroller -t 5 -o @/k.csv --animate @/k.html --json @/k.json)"), 1);
  assert_non_null (strstr (cli_err, "the table so far is kept in "));
  assert_non_null (strstr (cli_err, "the page is kept in "));
  assert_non_null (strstr (cli_err, "the summary is kept in "));
  cli_good ("rm @/k.csv.part @/k.html.part @/k.json.part");
}

/* ---- Outputs that are not regular files ---- */

TEST (direct) {
#define OUTPUT_RUN "pinwheel run ezyroller -t 0.01 -o "
/* waits until the last process in the background catches SIGTERM (15) */
#define CATCHES "while kill -0 $! && ! grep -q 'SigCgt:.*[4-7c-f]...$' /proc/$!/status; do sleep 0.02; done\n"
  for (const char *const *n = (const char *const[]){ "-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", NULL }; *n;
       n++) {
    if (**n == '/' && access ("/proc/self/fd/1", F_OK) != 0) continue;
    cli_good (
        check_text ("echo old >@/all; " OUTPUT_RUN "%s >>@/all; cat @/all | wc -l; " OUTPUT_RUN "%s | wc -l", *n, *n));
    assert_string_equal (cli_out, "13\n12\n");
  }
  if (access ("/dev/fd/1", F_OK) == 0) {
    cli_good ("echo old >@/all; " OUTPUT_RUN "/dev/fd/5 5>>@/all; wc -l <@/all");
    assert_string_equal (cli_out, "13\n");
    cli_bad (OUTPUT_RUN "/dev/fd/5 5<@/all", 1, "cannot write /dev/fd/5: Bad file descriptor");
  }
  cli_good ("mkfifo @/fifo; wc -l <@/fifo & " OUTPUT_RUN
            "@/fifo; wait; [ -p @/fifo ] && ls @/*.part 2>/dev/null || true");
  assert_string_equal (cli_out, "12\n");
  cli_run ("\"${PINWHEEL:-build/pinwheel}\" run ezyroller -t 1e6 -o @/fifo &\n" CATCHES
           "kill -TERM $!; wait $!; echo $?");
  assert_string_equal (cli_out, "130\n");
  /* a signal while a full pipe waits for its reader */
  cli_run ("exec 3<>@/fifo\n\"${PINWHEEL:-build/pinwheel}\" run ezyroller -t 1e5 -o @/fifo & run=$!\n" CATCHES
           "while kill -0 $run && ! grep -q 'State:.S' /proc/$run/status; do sleep 0.02; done\n"
           "kill -TERM $run; sleep 0.2; cat <&3 >/dev/null & wait $run; echo $?; kill $!");
  assert_string_equal (cli_out, "130\n");
  cli_bad ("pinwheel run ezyroller --checkpoint /dev/null", 2,
           "/dev/null: a checkpoint needs a regular file, which can be read again and replaced");
}

/* ---- What is replaced ---- */

TEST (mode) {
  struct stat info;
  for (int mode = 0600; mode <= 0664; mode += 064) {
    cli_good ("rm -f @/mode.csv; echo old >@/mode.csv");
    assert_int_equal (chmod (cli_path ("mode.csv"), (mode_t)mode), 0);
    if (getuid () == 0) assert_int_equal (chown (cli_path ("mode.csv"), 12345, 23456), 0);
    cli_good (OUTPUT_RUN "@/mode.csv; wc -l <@/mode.csv");
    assert_string_equal (cli_out, "12\n");
    assert_int_equal (stat (cli_path ("mode.csv"), &info), 0);
    assert_int_equal (info.st_mode & 07777, mode);
    if (getuid () == 0) assert_true (info.st_uid == 12345 && info.st_gid == 23456);
  }
}

/* Of two outputs both are complete or none: the summary's folder goes away during the run. */
TEST (together) {
  cli_run ("mkdir -p @/t/sub; cd @/t\n"
           "\"$OLDPWD/${PINWHEEL:-build/pinwheel}\" run ezyroller -t 20 -o a.csv --json sub/a.json >log 2>&1 & p=$!\n"
           "while kill -0 $! 2>/dev/null && [ ! -s a.csv.part ]; do sleep 0.01; done; rm -r sub; wait $p; echo $?; ls");
  assert_string_equal (cli_out, "1\na.csv.part\nlog\n");
}

static void output_put (pw_output *o, const char *text) {
  assert_non_null (o);
  fputs (text, pw_output_stream (o));
}

/* A user who may give the new file the group of the old one, but not its owner, gets no program that runs as the
 * latter. */
TEST (set_user) {
  struct stat info;
  int how;
  if (getuid () != 0) skip ();
  cli_good ("mkdir @/s && chmod 777 @/s && echo old >@/s/a && chown 12345:23456 @/s/a && chmod 6775 @/s/a");
  pid_t child = fork ();
  if (child == 0) {
    if (chdir (cli_path ("s")) || setgroups (1, (gid_t[]){ 23456 }) || setgid (34567) || setuid (34567)) _exit (2);
    pw_output *o = pw_output_open ("a", NULL);
    _exit (o && pw_output_finish (o, NULL) == PW_OK ? 0 : 3); /* empty: writing would remove the bits anyway */
  }
  waitpid (child, &how, 0);
  assert_int_equal (how, 0);
  assert_int_equal (stat (cli_path ("s/a"), &info), 0);
  assert_true (info.st_uid == 34567 && info.st_gid == 23456);
  assert_int_equal (info.st_mode & 07777, 02775);
}

static int without_links; /* 1: on a file system that has no hard links */

int link (const char *from, const char *to) {
  errno = EPERM;
  return without_links ? -1 : linkat (AT_FDCWD, from, AT_FDCWD, to, 0);
}

/* If the second of two outputs cannot be renamed, the first one's predecessor keeps its name. */
TEST (predecessor) {
  pw_output *o[3] = { NULL };
  for (int k = 0; k < 4; k++) {
    pw_error error = { 0 };
    int fails = k < 2;
    without_links = k % 2;
    cli_good ("rm -rf @/p; mkdir @/p; echo old >@/p/a; echo old >@/p/b; echo old >@/p/a.part.old");
    for (int i = 0; i < 2; i++) output_put (o[i] = pw_output_open (cli_path (i ? "p/b" : "p/a"), &error), "new\n");
    if (fails) cli_good ("rm @/p/b; mkdir @/p/b");
    assert_int_equal (pw_output_finish_all (o, 3, &error), fails ? PW_RESOURCE : PW_OK);
    cli_good ("cd @/p; grep -s . * || true");
    assert_string_equal (cli_out, fails ? "a:old\na.part:new\nb.part:new\n" : "a:new\nb:new\n");
  }
}

/* ---- What is read ---- */

TEST (types) {
  cli_good ("rm -rf @/r; mkdir -p @/r/D; mkfifo @/r/pipe @/r/p.yaml; ln -s /dev/zero @/r/z.yaml; "
            ": >@/r/x.cpp");
#define OUTPUT_PIPE ": it is a FIFO or pipe, not a regular file"
#define OUTPUT_ZERO ": it is a character device, not a regular file"
#define OUTPUT_FOLDER ": it is a directory, not a regular file"
  const cli_wrong each[] = {
    { "run @/r/p.yaml", "cannot open @/r/p.yaml" OUTPUT_PIPE },
    { "run @/r/z.yaml", "cannot open @/r/z.yaml" OUTPUT_ZERO },
    { "run @/r/D", "cannot open @/r/D" OUTPUT_FOLDER },
    { "run /dev/zero", "cannot open /dev/zero" OUTPUT_ZERO },
    { "run ezyroller -t 1 --reference @/r/pipe", "@/r/pipe: cannot be read" OUTPUT_PIPE },
    { "run ezyroller -t 1 --reference @/r/pipe --checkpoint @/r/c", "cannot read @/r/pipe" OUTPUT_PIPE },
    { "run ezyroller -t 1 --reference /dev/zero", "/dev/zero: cannot be read" OUTPUT_ZERO },
    { "run ezyroller -t 1 --reference @/r/D", "@/r/D: cannot be read" OUTPUT_FOLDER },
    { "run ezyroller --reference /proc/self/mem", "cannot read /proc/self/mem: Input/output error" },
    { "run ezyroller -t 1 --resume @/r/pipe", "cannot read the checkpoint @/r/pipe" OUTPUT_PIPE },
    { "sweep --merge @/r/pipe -o @/r/m.csv", "cannot open the part @/r/pipe" OUTPUT_PIPE },
    { "sweep --merge /dev/zero -o @/r/m.csv", "cannot open the part /dev/zero" OUTPUT_ZERO },
    { "run @/r/x.cpp", "@/r/x.cpp: a model is compiled as C, not as C++: write it in C, in a file that ends in .c" },
  };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++) {
    cli_bad (check_text ("pinwheel %s", each[i].arguments), 2, each[i].message);
  }
}

/* Five megabytes that open brackets, in less memory than the 340 bytes that libfyaml keeps for each; as many entries
 * of a list that may be a key; a line without an end.  An address sanitizer needs more by itself. */
TEST (bounded) {
#ifdef __SANITIZE_ADDRESS__
  skip ();
#endif
  cli_good (
      "head -c 5000000 /dev/zero | tr '\\0' '[' >@/deep.yaml; (printf 'x: ['; head -c 5000000 /dev/zero | tr '\\0' "
      "'[') "
      ">@/key.yaml; (printf '['; yes '0,' | head -n 2000000 | tr -d '\\n'; echo '0]') >@/wide.yaml; "
      "head -c 200000000 /dev/zero | tr '\\0' 1 >@/line.csv; (echo 't,frame.x'; head -c 9 /dev/zero) >@/zero.csv; "
      "printf 't,frame.x\\n1,2\\000\\n' >@/zero2.csv");
#define OUTPUT_LESS "ulimit -v 700000; pinwheel "
  assert_int_equal (cli_run (OUTPUT_LESS "show @/deep.yaml"), 2);
  assert_non_null (strstr (cli_err, "nested too deeply"));
  assert_int_equal (cli_run (OUTPUT_LESS "show @/key.yaml"), 2);
  assert_non_null (strstr (cli_err, "nested too deeply"));
  assert_int_equal (cli_run (OUTPUT_LESS "show @/wide.yaml"), 2);
  assert_non_null (strstr (cli_err, "wide.yaml:1:1: error: a list or map in brackets with more than 1e+06 commas"));
  cli_bad (OUTPUT_LESS "run ezyroller --reference @/line.csv", 2,
           "@/line.csv:1: there are no names of columns before the numbers, so no \"t\"");
  cli_bad ("pinwheel run ezyroller --reference @/zero.csv", 2, "@/zero.csv: a table is text, and this has a byte 0");
  cli_bad ("pinwheel run ezyroller --reference @/zero2.csv", 2, "@/zero2.csv: a table is text, and this has a byte 0");
  static const char *const many[] = { "sweep pendulum --vary l=1:2:9999 -o @/many.csv",
                                      "optimise pendulum --minimise pivot.Fx --free l=1:2 --starts 9999" };
  for (int i = 0; i < 2; i++)
    cli_bad (check_text ("ulimit -v 2000000; pinwheel %s -t 0.1 --jobs 9999 2>@/err9; s=$?; "
                         "sed 's/only [0-9]*/only N/; s/jobs [0-9]*/jobs N/; s/N: .*;/N;/' @/err9 >&2; exit $s",
                         many[i]),
             1, "cannot start 9999 runs at a time, only N; try --jobs N");
  cli_good ("{ echo 'pinwheel: 1'; yes '# größer' | head -n 20000; echo 'odd: 1'; } >@/far.yaml");
  assert_int_equal (cli_run ("pinwheel show @/far.yaml"), 2); /* libfyaml counts offsets modulo 65536 */
  assert_non_null (strstr (cli_err, "far.yaml:20002:1: error: a model has no \"odd\""));
  cli_good ("rm @/*.yaml @/line.csv");
}

/* The number of a checkpoint's state that has a value, and those after it. */
static double *output_find (const pw_checkpoint *c, double value) {
  for (size_t i = 0; i + sizeof value <= c->state.size; i += 4) {
    double x;
    memcpy (&x, c->state.at + i, sizeof x);
    if (fabs (x - value) < 1e-9) return (double *)(void *)(c->state.at + i);
  }
  return NULL;
}

/* A checkpoint with a good check sum whose state no run has written: of its numbers one, counted from the time or, if
 * it is negative, from the two before the run's own, the number of rows and the processor time. */
static void output_forge (int number, double value) {
  pw_checkpoint c;
  pw_error error = { 0 };
  cli_good ("pinwheel run n-trailer -m rk4 --step 0.01 -t 0.6 --checkpoint @/f.ck --checkpoint-every 0.25 >@/log");
  check_ok (pw_checkpoint_read (cli_path ("f.ck"), &c, &error), &error);
  double *t = output_find (&c, 0.5);
  assert_non_null (t);
  unsigned char *place = number < 0 ? c.state.at + 2 * sizeof value : (unsigned char *)t;
  memcpy (place + number * (int)sizeof value, &value, sizeof value);
  char *head = strndup (c.text, (size_t)(c.head_end - c.text));
  pw_archive state = { .at = c.state.at, .used = c.state.size };
  check_ok (pw_checkpoint_write (cli_path ("f.ck"), head, &state, &error), &error);
  free (head);
  pw_checkpoint_free (&c);
  int status = cli_run ("pinwheel run n-trailer -m rk4 --step 0.01 -t 0.6 --resume @/f.ck --checkpoint-every 0.25");
  if (status != 2) print_error ("number %d is %g: %d %s", number, value, status, cli_err);
  assert_int_equal (status, 2);
  assert_non_null (strstr (cli_err, "is not that of a run"));
}

TEST (forged) {
  output_forge (0, NAN);
  output_forge (0, -0.25);
  output_forge (0, 0.75);
  output_forge (16, NAN); /* coordinates, after the 16 numbers of a run */
  output_forge (18, INFINITY);
  output_forge (16 + 9, NAN); /* velocities */
  output_forge (-1, NAN);
  output_forge (-1, -1);
  output_forge (-2, -1); /* as an integer: negative */
}

/* One table in three formats; old spellings of ranges and folders work with a notice. */
TEST (tables) {
  cli_good ("pinwheel sweep pendulum --vary l=1:2:3 --of max:bob.vx -t 0.1 -o @/t.csv && "
            "pinwheel sweep pendulum --vary l=1:2:3 --of max:bob.vx -t 0.1 -o @/t.json --json @/s.json --plots @/t && "
            "pinwheel sweep pendulum --vary l=1:2:3 --of max:bob.vx -t 0.1 -o @/t.npz && "
            "python3 -c 'import csv, json, zipfile\n"
            "rows = list (csv.DictReader (open (\"@/t.csv\")))\n"
            "table = json.load (open (\"@/t.json\"))\n"
            "assert list (table) == list (rows[0]) and table[\"status\"] == [\"ok\"] * 3\n"
            "for k, v in table.items (): assert k in (\"status\", \"reason\") or v == [float (r[k]) for r in rows], k\n"
            "npz = zipfile.ZipFile (\"@/t.npz\")\n"
            "assert npz.namelist () == [k.split (\" [\")[0] + \".npy\" for k in table]\n"
            "text = lambda name: npz.read (name + \".npy\")[128:].decode (\"utf-32\").replace (\"\\0\", \"\")\n"
            "assert text (\"status\") == \"okokok\" and text (\"reason\") == \"\"\n"
            "s = json.load (open (\"@/s.json\")); assert s[\"runs\"] == 3 and s[\"failed\"] == 0'");
  assert_non_null (strstr (cli_file ("t/sweep.svg"), "max:bob.vx"));
  cli_good (
      "pinwheel sweep pendulum --vary l=lin:1:2:3 --of max:bob.vx -t 0.1 -o @/old.csv 2>@/notice && cmp @/t.csv "
      "@/old.csv && pinwheel steady pendulum --starts 0 -o @/old 2>@/notices && ls @/old/steady.csv @/old/steady.json");
  assert_string_equal (cli_file ("notice"), "pinwheel: --vary l=lin:1:2:3: an old spelling of l=1:2:3\n");
  assert_non_null (strstr (cli_file ("notices"), "an old spelling of -o "));
}

/* Formats that are not written are refused with those that are, before anything is written; so are folders with the
 * names of files.  What follows a dot need not be a format. */
TEST (formats) {
  static const char csv_or_npz[] = "the format %s is not written: expected a name that ends in .csv or .npz",
                    folder[] = "expected the name of a folder, in which files are written";
  static const char *const ending[] = { ".xlsx", ".mat", ".json", ".h5", ".txt", ".html" };
  cli_good ("mkdir -p @/formats/old.csv");
  for (size_t i = 0; i < sizeof ending / sizeof *ending; i++) {
    cli_bad (check_text ("pinwheel run pendulum -t 1 -o @/formats/a%s", ending[i]), 2,
             check_text ("-o @/formats/a%s: %s", ending[i], check_text (csv_or_npz, ending[i])));
  }
  const cli_wrong each[] = {
    { "sweep pendulum --vary l=1,2 -o @/formats/a.xlsx", "is not written: expected a name that ends in .csv" },
    { "optimise pendulum --maximise bob.phi --free l=1:2 -o @/formats/a.csv",
      "expected a name that ends in .yaml or .yml" },
    { "run pendulum --json @/formats/a.txt", "the format .txt is not written: expected a name that ends in .json" },
    { "run pendulum --plots @/formats/a.png", folder },
    { "compare pendulum --plots @/formats/a.csv", folder },
    { "drift pendulum -o @/formats/a.pdf", "the format .pdf is not written: expected a name that ends in .csv" },
    { "steady pendulum --plots @/formats/a.json", folder },
    { "sensitivity pendulum --of bob.phi --by l -o @/formats/a.yaml",
      "the format .yaml is not written: expected a name that ends in .csv, .npz or .json" },
    { "linearise pendulum -o @/formats/a.svg", "expected a name that ends in .csv, .npz or .json" },
    { "check pendulum --json @/formats/a.yaml", "expected a name that ends in .json" },
  };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++) {
    assert_int_equal (cli_run (check_text ("pinwheel %s", each[i].arguments)), 2);
    if (!strstr (cli_err, each[i].message)) print_error ("%s\n%s", each[i].arguments, cli_err);
    assert_non_null (strstr (cli_err, each[i].message));
  }
  cli_good ("ls @/formats");
  assert_string_equal (cli_out, "old.csv\n");
  cli_shell ("pinwheel run pendulum -t 0.01 --every 0.01 -o @/formats/l=0.5 --plots @/formats/old.csv");
  cli_shell ("pinwheel run pendulum -t 0.01 --every 0.01 -o @/formats/A.CSV");
  cli_shell ("pinwheel run pendulum -t 0.01 --every 0.01 -o @/formats/a.csv.old");
  cli_good ("cmp @/formats/l=0.5 @/formats/A.CSV; cmp @/formats/l=0.5 @/formats/a.csv.old");
}

/* A checkpoint that cannot be written leaves nothing, and the message names nothing. */
TEST (not_written) {
  char head[6000];
  struct rlimit before;
  pw_error error = { 0 };
  memset (head, 'a', sizeof head - 1);
  head[sizeof head - 1] = 0;
  void (*handler) (int) = signal (SIGXFSZ, SIG_IGN);
  getrlimit (RLIMIT_FSIZE, &before);
  setrlimit (RLIMIT_FSIZE, &(struct rlimit){ 4096, before.rlim_max });
  int status = pw_checkpoint_write (cli_path ("full.ck"), head, &(pw_archive){ .used = 0 }, &error);
  setrlimit (RLIMIT_FSIZE, &before);
  signal (SIGXFSZ, handler);
  assert_int_equal (status, PW_RESOURCE);
  assert_null (strstr (error.text, "what was written"));
  cli_good ("[ -z \"$(ls @ | grep full)\" ]");
}

const check_fixture fixture = { cli_setup, cli_teardown };
