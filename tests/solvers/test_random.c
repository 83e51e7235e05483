/* Some random mechanisms; slow_random has a thousand. */
#include "check.h"
#include "mechanism.h"

static void test_random (void **state) {
  (void)state;
  mechanism_test (1, 120);
}

int main (void) {
  const struct CMUnitTest tests[] = { cmocka_unit_test (test_random) };
  return cmocka_run_group_tests (tests, NULL, NULL);
}
