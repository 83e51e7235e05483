/* The layout of the structures that plug-ins and Pinwheel exchange, for one value of PW_ABI.  After a change of the
 * layout enter the new one here and, once 0.1.0 is out, raise PW_ABI, so that plug-ins compiled before are refused. */
#include <assert.h>
#include <stdio.h>
#include <string.h>
#include "check.h"
#include "pinwheel-method.h"
#include "util.h"

#if PW_ABI == 1 && defined __LP64__

#define LAYOUT(type, bytes) static_assert (sizeof (type) == bytes, #type " has changed: see the top of this file")
#define LAYOUT_AT(type, member, at) \
  static_assert (offsetof (type, member) == at, #type " has changed: see the top of this file")
#define LAYOUT_VALUE(constant, value) \
  static_assert (constant == value, #constant " has changed: see the top of this file")

LAYOUT (pw_error, 504);
LAYOUT (pw_function, 72);
LAYOUT (pw_signal, 88);
LAYOUT (pw_signal_text, 32);
LAYOUT (pw_body, 88);
LAYOUT (pw_parameter, 48);
LAYOUT (pw_run_defaults, 32);
LAYOUT (pw_plugin_table, 104);
LAYOUT (pw_field, 72);
LAYOUT (pw_quantity, 32);
LAYOUT (pw_internal, 32);
LAYOUT (pw_configuration, 64);
LAYOUT (pw_batch, 72);
LAYOUT (pw_kind, 336);
LAYOUT (pw_path_place, 88);
LAYOUT (pw_bounds, 72);
LAYOUT (pw_method, 104);
LAYOUT (pw_option, 56);
LAYOUT (pw_stabilisation, 24);
LAYOUT (pw_settings, 120);
LAYOUT (pw_reached, 64);

LAYOUT_AT (pw_error, text, 4);
LAYOUT_AT (pw_signal, constant, 8);
LAYOUT_AT (pw_function, context, 8);
LAYOUT_AT (pw_function, reads, 16);
LAYOUT_AT (pw_function, breakpoint, 24);
LAYOUT_AT (pw_function, open, 32);
LAYOUT_AT (pw_function, close, 40);
LAYOUT_AT (pw_function, text, 48);
LAYOUT_AT (pw_function, range, 56);
LAYOUT_AT (pw_function, sides, 64);
LAYOUT_AT (pw_body, mass, 8);
LAYOUT_AT (pw_body, inertia, 16);
LAYOUT_AT (pw_body, start, 24);
LAYOUT_AT (pw_body, rate, 48);
LAYOUT_AT (pw_body, specified, 72);
LAYOUT_AT (pw_body, corners, 76);
LAYOUT_AT (pw_body, outline, 80);
LAYOUT_AT (pw_parameter, offset, 8);
LAYOUT_AT (pw_parameter, value, 16);
LAYOUT_AT (pw_parameter, unit, 24);
LAYOUT_AT (pw_parameter, about, 32);
LAYOUT_AT (pw_parameter, domain, 40);
LAYOUT_AT (pw_run_defaults, step, 8);
LAYOUT_AT (pw_run_defaults, rtol, 16);
LAYOUT_AT (pw_run_defaults, method, 24);
LAYOUT_AT (pw_plugin_table, size, 8);
LAYOUT_AT (pw_plugin_table, about, 16);
LAYOUT_AT (pw_plugin_table, parameters, 24);
LAYOUT_AT (pw_plugin_table, parameters_size, 32);
LAYOUT_AT (pw_plugin_table, run, 40);
LAYOUT_AT (pw_plugin_table, build, 80);
LAYOUT_AT (pw_plugin_table, reference, 88);
LAYOUT_AT (pw_plugin_table, methods, 96);
LAYOUT_AT (pw_field, offset, 8);
LAYOUT_AT (pw_field, type, 16);
LAYOUT_AT (pw_field, count, 20);
LAYOUT_AT (pw_field, unit, 24);
LAYOUT_AT (pw_field, required, 32);
LAYOUT_AT (pw_field, domain, 36);
LAYOUT_AT (pw_field, choices, 40);
LAYOUT_AT (pw_field, about, 48);
LAYOUT_AT (pw_field, given, 56);
LAYOUT_AT (pw_field, limit, 64);
LAYOUT_AT (pw_quantity, unit, 8);
LAYOUT_AT (pw_quantity, rate, 16);
LAYOUT_AT (pw_quantity, about, 24);
LAYOUT_AT (pw_internal, start, 8);
LAYOUT_AT (pw_internal, rate, 16);
LAYOUT_AT (pw_configuration, phi, 16);
LAYOUT_AT (pw_configuration, cos, 24);
LAYOUT_AT (pw_configuration, sin, 32);
LAYOUT_AT (pw_configuration, vx, 40);
LAYOUT_AT (pw_configuration, omega, 56);
LAYOUT_AT (pw_batch, cols, 4);
LAYOUT_AT (pw_batch, element, 8);
LAYOUT_AT (pw_batch, body, 16);
LAYOUT_AT (pw_batch, configuration, 24);
LAYOUT_AT (pw_batch, q, 32);
LAYOUT_AT (pw_batch, v, 40);
LAYOUT_AT (pw_batch, u, 48);
LAYOUT_AT (pw_batch, w, 56);
LAYOUT_AT (pw_batch, lambda, 64);
LAYOUT_AT (pw_kind, about, 8);
LAYOUT_AT (pw_kind, definition, 16);
LAYOUT_AT (pw_kind, element, 24);
LAYOUT_AT (pw_kind, fields, 32);
LAYOUT_AT (pw_kind, bodies, 40);
LAYOUT_AT (pw_kind, internal, 44);
LAYOUT_AT (pw_kind, rows, 48);
LAYOUT_AT (pw_kind, signals, 52);
LAYOUT_AT (pw_kind, each_body, 56);
LAYOUT_AT (pw_kind, constant, 60);
LAYOUT_AT (pw_kind, level, 64);
LAYOUT_AT (pw_kind, first_order, 68);
LAYOUT_AT (pw_kind, of_coordinate, 72);
LAYOUT_AT (pw_kind, reaction, 80);
LAYOUT_AT (pw_kind, coordinate, 88);
LAYOUT_AT (pw_kind, reaction_unit, 96);
LAYOUT_AT (pw_kind, prepare, 104);
LAYOUT_AT (pw_kind, g, 112);
LAYOUT_AT (pw_kind, g_size, 120);
LAYOUT_AT (pw_kind, eta, 128);
LAYOUT_AT (pw_kind, J, 136);
LAYOUT_AT (pw_kind, gamma, 144);
LAYOUT_AT (pw_kind, J_gamma, 152);
LAYOUT_AT (pw_kind, force, 160);
LAYOUT_AT (pw_kind, force_u, 168);
LAYOUT_AT (pw_kind, jw_q, 176);
LAYOUT_AT (pw_kind, eta_q, 184);
LAYOUT_AT (pw_kind, gamma_q, 192);
LAYOUT_AT (pw_kind, gamma_v, 200);
LAYOUT_AT (pw_kind, J_u, 208);
LAYOUT_AT (pw_kind, eta_u, 216);
LAYOUT_AT (pw_kind, gamma_u, 224);
LAYOUT_AT (pw_kind, force_q, 232);
LAYOUT_AT (pw_kind, force_v, 240);
LAYOUT_AT (pw_kind, energy, 248);
LAYOUT_AT (pw_kind, power, 256);
LAYOUT_AT (pw_kind, loss, 264);
LAYOUT_AT (pw_kind, contact, 272);
LAYOUT_AT (pw_kind, saturation, 280);
LAYOUT_AT (pw_kind, symbol, 288);
LAYOUT_AT (pw_kind, limits, 296);
LAYOUT_AT (pw_kind, exact, 304);
LAYOUT_AT (pw_kind, is_exact, 312);
LAYOUT_AT (pw_kind, companion, 320);
LAYOUT_AT (pw_kind, has_companion, 328);
LAYOUT_AT (pw_bounds, least, 0);
LAYOUT_AT (pw_bounds, most, 8);
LAYOUT_AT (pw_bounds, sliding, 16);
LAYOUT_AT (pw_bounds, restitution, 32);
LAYOUT_AT (pw_bounds, circle, 40);
LAYOUT_AT (pw_bounds, initially_slides, 44);
LAYOUT_AT (pw_bounds, signal, 48);
LAYOUT_AT (pw_bounds, relative, 64);
LAYOUT_AT (pw_bounds, partner, 68);
LAYOUT_AT (pw_method, about, 8);
LAYOUT_AT (pw_method, adaptive, 16);
LAYOUT_AT (pw_method, order, 20);
LAYOUT_AT (pw_method, stabilisations, 24);
LAYOUT_AT (pw_method, options, 32);
LAYOUT_AT (pw_method, refused, 40);
LAYOUT_AT (pw_method, locates_no_events, 48);
LAYOUT_AT (pw_method, open, 56);
LAYOUT_AT (pw_method, advance, 64);
LAYOUT_AT (pw_method, at, 72);
LAYOUT_AT (pw_method, restart, 80);
LAYOUT_AT (pw_method, close, 88);
LAYOUT_AT (pw_method, serialise, 96);
LAYOUT_AT (pw_option, with, 8);
LAYOUT_AT (pw_option, value, 16);
LAYOUT_AT (pw_option, domain, 24);
LAYOUT_AT (pw_option, choices, 32);
LAYOUT_AT (pw_option, unit, 40);
LAYOUT_AT (pw_option, about, 48);
LAYOUT_AT (pw_stabilisation, about, 8);
LAYOUT_AT (pw_stabilisation, kind, 16);
LAYOUT_AT (pw_reached, settings, 8);
LAYOUT_AT (pw_reached, t, 16);
LAYOUT_AT (pw_reached, breakpoint, 24);
LAYOUT_AT (pw_reached, q, 32);
LAYOUT_AT (pw_reached, v, 40);
LAYOUT_AT (pw_reached, a, 48);
LAYOUT_AT (pw_reached, lambda, 56);

LAYOUT_VALUE (PW_CONSTANT, 0);
LAYOUT_VALUE (PW_HARMONIC, 1);
LAYOUT_VALUE (PW_FUNCTION, 2);
LAYOUT_VALUE (PW_RAMP, 3);
LAYOUT_VALUE (PW_SMOOTH_STEP, 4);
LAYOUT_VALUE (PW_PULSE, 5);
LAYOUT_VALUE (PW_TABLE, 6);
LAYOUT_VALUE (PW_LINEAR, 0);
LAYOUT_VALUE (PW_CUBIC, 1);
LAYOUT_VALUE (PW_ENDS_FREE, 0);
LAYOUT_VALUE (PW_ENDS_REST, 1);
LAYOUT_VALUE (PW_REAL, 0);
LAYOUT_VALUE (PW_NONNEGATIVE, 1);
LAYOUT_VALUE (PW_POSITIVE, 2);
LAYOUT_VALUE (PW_COUNT, 3);
LAYOUT_VALUE (PW_FRACTION, 4);
LAYOUT_VALUE (PW_NUMBER, 0);
LAYOUT_VALUE (PW_POINT, 1);
LAYOUT_VALUE (PW_VECTOR, 2);
LAYOUT_VALUE (PW_BODY, 3);
LAYOUT_VALUE (PW_SIGNAL, 4);
LAYOUT_VALUE (PW_CHOICE, 5);
LAYOUT_VALUE (PW_TRACK, 7);
LAYOUT_VALUE (PW_FORCE, 0);
LAYOUT_VALUE (PW_HOLONOMIC, 1);
LAYOUT_VALUE (PW_NONHOLONOMIC, 2);
LAYOUT_VALUE (PW_OK, 0);
LAYOUT_VALUE (PW_RETRY, 1);
LAYOUT_VALUE (PW_RESOURCE, -1);
LAYOUT_VALUE (PW_INPUT, -2);
LAYOUT_VALUE (PW_INITIAL, -3);
LAYOUT_VALUE (PW_METHOD, -4);

/* A checksum of the size and the fields of a definition. */
static unsigned long long layout_of (const pw_kind *k) {
  unsigned long long sum = pw_check_sum (PW_CHECK, &k->definition, sizeof k->definition);
  for (const pw_field *f = k->fields; f->name; f++) {
    sum = pw_check_sum (sum, f->name, strlen (f->name));
    sum = pw_check_sum (sum, &f->offset, sizeof f->offset);
    sum = pw_check_sum (sum, &f->type, sizeof f->type);
    sum = pw_check_sum (sum, &f->count, sizeof f->count);
    for (const char *const *c = f->choices; c && *c; c++) sum = pw_check_sum (sum, *c, strlen (*c) + 1);
  }
  return sum;
}

/* Enter a new element type here, too; PW_ABI stays. */
TEST (definitions) {
  static const struct {
    const char *kind;
    unsigned long long layout;
  } known[] = {
    { "pin", 0x2e992ed58a0ca1ea },           { "weld", 0x96d837462e580df9 },
    { "slider", 0x72bb16fc630c9167 },        { "slot", 0x3a0f550a70778644 },
    { "rod", 0xa1a350acfa57b8de },           { "gear", 0xf8074be7c4f42d05 },
    { "stop", 0x140184392f9eeb3b },          { "rope", 0x63fe52bab6421076 },
    { "contact", 0x6a96e4785884d24c },       { "freewheel", 0x1b30733283cdb584 },
    { "drive", 0x4a0acb8a2a058e06 },         { "wheel", 0x2253ff33946cd27d },
    { "rolling-wheel", 0x22018cdff897fb65 }, { "steered-wheel", 0x4d59c3fe7efd1064 },
    { "speed", 0x1c914294429d6241 },         { "pfaffian", 0x2821cc1abfffa77a },
    { "tyre", 0xa42b832e02a24eda },          { "rolling-resistance", 0x267227c53db66752 },
    { "spring", 0x80a9821575f7667f },        { "rotational-spring", 0x3c20ed7f38c90acc },
    { "friction", 0xb489bb9d66b7e9b4 },      { "sliding-friction", 0x5fd1939a23f75811 },
    { "drag", 0x79bea784c473bb98 },          { "gravity", 0xed353e1dda5787ff },
    { "force", 0x74eb3b9f27c269 },           { "on-curve", 0xd956d93e2d1765bd },
    { "torque", 0xd760d1152b443519 },        { "motor", 0x1988e9bb33ec3a81 },
    { "state", 0xbd1a13601c72c5f8 },         { "marker", 0xa45ad3f1c6e75b4a },
  };
  int bad = 0;
  for (const pw_kind *const *k = pw_kinds; *k; k++) {
    size_t i = 0;
    while (i < sizeof known / sizeof *known && strcmp (known[i].kind, (*k)->name) != 0) i++;
    if (i < sizeof known / sizeof *known && known[i].layout == layout_of (*k)) continue;
    print_error ("{ \"%s\", 0x%llx },\n", (*k)->name, layout_of (*k));
    bad++;
  }
  if (bad) print_error ("these definitions are new or have changed: see the top of this file\n");
  assert_int_equal (bad, 0);
}

#else

TEST (definitions) {
  print_message ("no layout is known for ABI %d on this machine\n", PW_ABI);
  skip ();
}

#endif
