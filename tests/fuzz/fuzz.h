/* What the fuzz targets share.  Each is one file with LLVMFuzzerTestOneInput, which takes bytes and must neither crash,
 * hang nor leak; run from the top folder. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>

int LLVMFuzzerTestOneInput (const uint8_t *data, size_t size);

/* Writes the bytes to a file of this process's own and returns its path; the next call writes it anew. */
const char *fuzz_file (const uint8_t *data, size_t size, const char *ending);

/* A copy of the bytes that ends in a NUL; to be released. */
char *fuzz_text (const uint8_t *data, size_t size);

/* Cuts a text at its line ends into at most `most` pieces; a list ended by NULL. */
int fuzz_lines (char *text, const char **line, int most);

/* What a mutator adds to texts: rules, each a letter, a colon and alternatives between backticks, in which $e stands
 * for a text by rule e.  The first alternative ends: it is taken where the text gets too deep.  Ended by NULL; the
 * first rule is that of whole texts. */
typedef const char *const fuzz_grammar;

/* Writes a text by the first rule, without NUL; returns its size. */
size_t fuzz_grow (fuzz_grammar *rules, unsigned seed, int depth, uint8_t *text, size_t most);

/* A mutation for LLVMFuzzerCustomMutator: by bytes, a new text by the grammar, a piece by one of its rules, or pieces
 * of the text copied, moved, removed or repeated. */
size_t fuzz_mutate (fuzz_grammar *rules, uint8_t *data, size_t size, size_t most, unsigned seed);

size_t LLVMFuzzerMutate (uint8_t *data, size_t size, size_t most);
size_t LLVMFuzzerCustomMutator (uint8_t *data, size_t size, size_t most, unsigned seed);

/* The pendulum, compiled once. */
struct pw_system *fuzz_pendulum (void);

#endif
