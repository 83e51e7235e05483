/* Internal interfaces of libpinwheel-files. */
#ifndef PW_FILES_H
#define PW_FILES_H

#include <limits.h>
#include <sys/stat.h>
#include "pinwheel-files.h"
#include "util.h"

/* The size of a buffer for a path: a path that is cut to it is still too long for the system, which refuses it. */
enum { PW_PATH = PATH_MAX + 1 };
/* Prints a path into the buffer, which is returned. */
#define pw_path(path, ...) pw_print (path, PW_PATH, __VA_ARGS__)

/* ---- Tables of numbers (columns.c) ---- */

/* Whether nan in a column other than the time is an error, or a gap like an empty cell; or empty cells are errors, too,
 * as in a path, of which the first column is not the time. */
typedef enum { PW_GAPS_REFUSED, PW_GAPS_ALLOWED, PW_GAPLESS } pw_gaps;
/* As pw_read_columns, from a stream, which stays open; `shown` is its path in messages, "SHOWN:LINE: REASON".  NULL in
 * place of a column: the first one, or the second one, which is not the time; without gaps: x and y by name, if there
 * are both. */
double *pw_columns_from_stream (FILE *f, const char *shown, const char *const *column, const char *const *unit,
                                int width, pw_gaps gaps, unsigned char *missing, int *rows, pw_error *error);
/* The length of the number at p: digits, perhaps with a point and an exponent; 0 if there is none (parser.c). */
size_t pw_number_size (const char *p);

/* ---- Outlines of bodies in drawings (svg.c) ---- */

/* Points; zero-initialised, none.  Free `point`. */
typedef struct {
  double (*point)[2];
  size_t count, room;
} pw_corners;
/* Appends the corners of the first path, polygon or polyline of a drawing, y upwards.  Returns why there are none, "it
 * has ...", or ""; PW_OK or PW_RESOURCE in *status. */
const char *pw_svg_outline (const char *text, pw_corners *corners, int *status);

/* ---- Units (columns.c) ---- */

/* A known unit: "mm" is "1e-3" of "m".  The first four are the base units. */
typedef struct {
  const char *name, *factor; /* the factor is an expression, with this value; "1": an SI unit */
  double value;
  const char *si;
} pw_unit_name;

extern const pw_unit_name pw_unit_names[]; /* ends with a NULL name */
/* Stores the power at p, after a name: "^2", "²", "2"; 1 if there is none, 0 if it is refused.  Returns its end. */
const char *pw_unit_power (const char *p, int *power);

/* ---- Reading (file.c, number.c) ---- */

/* As pw_read_rest, of the regular file at a path.  If it cannot be opened, the error is "FAILURE PATH: REASON". */
int pw_read_file (const char *failure, const char *path, size_t max_bytes, const char *limit, char **text, size_t *size,
                  pw_error *error);
/* Reads the rest of a file of at most `max_bytes` bytes into *text, zero-terminated; free it in every case.  `limit`
 * names the limit in messages: "the limit for a table".  PW_INPUT if the file is larger or unreadable; PW_RESOURCE. */
int pw_read_rest (FILE *f, size_t max_bytes, const char *path, const char *limit, char **text, size_t *size,
                  pw_error *error);

/* ---- Names of files (file.c) ---- */

/* Why a file is refused: "it is a directory, not a regular file". */
const char *pw_not_regular (mode_t mode);
/* Stores the folder of the file at a path in the buffer, which is returned. */
char *pw_folder_of (char folder[PW_PATH], const char *path);

/* ---- Locks (file.c) ---- */

typedef enum {
  PW_LOCK_NEW,     /* a new file; removes one left by a killed process */
  PW_LOCK_KEEP,    /* the existing file, or a new one */
  PW_LOCK_EXISTING /* the existing file; ENOENT if there is none */
} pw_lock_mode;

/* Opens a regular file for reading and writing and locks it until it is closed; a symbolic link is not followed.  -1
 * and errno. */
int pw_lock_file (const char *path, pw_lock_mode mode);

/* ---- Outputs (file.c) ---- */

/* PW_RESOURCE if a write to its stream has failed; set errno to 0 before writing, for the reason. */
int pw_output_check (pw_output *o, pw_error *error);
/* Whether the output was opened by pw_output_continue. */
int pw_output_continued (const pw_output *o);
/* 1 if its path has this ending. */
int pw_output_named (const pw_output *o, const char *ending);

#endif
