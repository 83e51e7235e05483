/* Included before every file of the engine: what wasi-libc lacks. */
char *realpath (const char *path, char *resolved);
