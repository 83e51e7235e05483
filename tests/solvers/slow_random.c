/* A thousand random mechanisms. */
#include "check.h"
#include "mechanism.h"

TEST (random) {
  mechanism_test (1, 1000);
}
