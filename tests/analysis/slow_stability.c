/* 780 eigenvalues of a net of springs, near the limit of `check`, with many nearly equal pairs. */
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "cli.h"

enum { NET = 130 };

/* The QR algorithm converges; exceptional shifts after every tenth step would prevent that. */
TEST (net) {
  static char text[40000];
  size_t n = (size_t)snprintf (text, sizeof text, "pinwheel: 1\nbodies:\n");
  for (int i = 1; i <= NET; i++)
    n += (size_t)snprintf (text + n, sizeof text - n,
                           "  - {name: b%d, mass: 1, inertia: 1, start: {x: %d, y: 0.1*%d*%d}}\n", i, i, i, i);
  n += (size_t)snprintf (text + n, sizeof text - n, "elements:\n");
  for (int i = 2; i <= NET; i++)
    n += (size_t)snprintf (
        text + n, sizeof text - n,
        "  - {spring: s%d, body: [b%d, b%d], at: [[0.1, 0.2], [0.3, 0]], stiffness: 100, damping: 0.1, "
        "length: 0.5}\n",
        i, i, i - 1);
  assert_true (n < sizeof text - 1);
  cli_write ("net.yaml", text);
  cli_good ("pinwheel check @/net.yaml");
  assert_non_null (strstr (cli_out, "  unknowns                           780\n"));
  assert_non_null (strstr (cli_out, "  fastest eigenvalue "));
}

const check_fixture fixture = { cli_setup, cli_teardown };
