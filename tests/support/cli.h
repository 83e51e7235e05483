/* Runs the program and reads its output, for the tests.
 *
 * PINWHEEL in the environment names the program, build/pinwheel otherwise; run from the top folder. */
#ifndef CLI_H
#define CLI_H

#include <stddef.h>

extern char cli_folder[];                    /* temporary folder for the files of a test program */
extern char cli_out[200000], cli_err[20000]; /* standard output and error of the last command */

/* Makes and removes the folder.  cli_setup_undrawn: without figures, for tests of numbers. */
int cli_setup (void);
int cli_setup_undrawn (void);
int cli_teardown (void);

/* Runs a shell command in which `pinwheel` is the program and @ the folder; returns its exit status. */
int cli_run (const char *command);

/* Runs a command that must succeed and write nothing to standard error. */
void cli_good (const char *command);

/* Runs a command that must succeed, with any messages. */
void cli_shell (const char *command);

/* Runs a command that must end with this status and one line on standard error: "pinwheel: MESSAGE". */
void cli_bad (const char *command, int status, const char *message);

/* Runs `pinwheel COMMAND ARGUMENTS` for each: all must fail as wrong input, with this message and no output. */
typedef struct {
  const char *arguments, *message;
} cli_wrong;
void cli_bad_each (const char *command, const cli_wrong *each, size_t count);

/* Replaces every @ by the folder. */
void cli_expand (const char *from, char *to, size_t size);

/* The path of a file in the folder, until the second call after this one, or the next command. */
const char *cli_path (const char *name);

/* Writes a file in the folder: a text; any bytes. */
void cli_write (const char *name, const char *text);
void cli_write_bytes (const char *name, const void *bytes, size_t size);

/* The text of a file in the folder, until the next call; NULL if there is none. */
const char *cli_file (const char *name);

/* Fails unless the last command has printed this text. */
void cli_shows (const char *text);

/* The number under the keys of a summary, in order: cli_number (json, "bodies", "frame", "x", NULL). */
double cli_number (const char *json, ...);

enum { CLI_MOST = 60 };

/* Numbers under a key of sens/sensitivity.json, in order, at most CLI_MOST; NaN for null.  Returns their number. */
int cli_sensitivity (const char *key, double *value);

/* 1 if the summary has this text under the key. */
int cli_says (const char *json, const char *key, const char *value);

#endif
