/* Every single allocation of the process is refused in turn: test_memory.c, with none left out. */
#define MEMORY_STRIDE 1
#include "test_memory.c"
