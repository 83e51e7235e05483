/* What the fuzz targets share.  Each is one file with LLVMFuzzerTestOneInput, which takes bytes and must neither crash,
 * hang nor leak; run from the top folder. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size);

/* Writes the bytes to a file of this process's own and returns its path; the next call writes it anew. */
const char *fuzz_file (const uint8_t *data, size_t size, const char *ending);

/* A copy of the bytes that ends in a NUL; to be freed. */
char *fuzz_text (const uint8_t *data, size_t size);

/* Cuts a text at its line ends into at most `most` pieces; a list ended by NULL. */
int fuzz_lines (char *text, const char **line, int most);

/* The pendulum, compiled once. */
struct pw_system *fuzz_pendulum (void);

#endif
