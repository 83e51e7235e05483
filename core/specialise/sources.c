/* Texts of the sources that generated code contains. */
#include <stddef.h>
#include "sources.h"
#include "sources.inc"
