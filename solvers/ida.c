#include "method.h"
const pw_method pw_method_ida = { .name = "ida", .about = "", .adaptive = 1 };
