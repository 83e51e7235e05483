/* Some random mechanisms; slow_random has a thousand. */
#include "check.h"
#include "mechanism.h"

TEST (random) {
  mechanism_test (1, 120);
}
