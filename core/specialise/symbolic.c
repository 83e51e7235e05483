/* Symbolic values and the statements that compute them; see symbolic.h. */
#include <ctype.h>
#include <string.h>
#include "symbolic.h"

pw_term pw_term_named (pw_term_type type, const char *array, int i, double value) {
  pw_term a = { type, 1, "", value };
  snprintf (a.name, sizeof a.name, "%s[%d]", array, i);
  return a;
}

const char *pw_term_text (pw_term a, char buffer[24]) {
  if (a.type == PW_TERM_ZERO) return "0";
  snprintf (buffer, 24, "%s%s", a.sign < 0 ? "-" : "", a.type == PW_TERM_ONE ? "1" : a.name);
  return buffer;
}

/* A new constant or variable; returns the stream that its statement, begun here, continues on. */
static FILE *emit_begin (pw_emitter *e, int constant, int sign, double value, pw_term *out) {
  *out = (pw_term){ constant ? PW_TERM_CONSTANT : PW_TERM_VARIABLE, sign, "", value };
  if (constant)
    *out = pw_term_named (PW_TERM_CONSTANT, "C", e->constants++, value), out->sign = sign;
  else
    snprintf (out->name, sizeof out->name, "x%d", e->variables++);
  fprintf (constant ? e->prepare : e->code, constant ? "  %s = " : "  const double %s = ", out->name);
  return constant ? e->prepare : e->code;
}

static int emit_is_constant (pw_term a) {
  return a.type != PW_TERM_VARIABLE;
}

pw_term pw_emit_product (pw_emitter *e, pw_term a, pw_term b) {
  pw_term out;
  if (a.type == PW_TERM_ZERO || b.type == PW_TERM_ZERO) return pw_term_zero ();
  if (a.type == PW_TERM_ONE) return a.sign < 0 ? pw_term_negative (b) : b;
  if (b.type == PW_TERM_ONE) return b.sign < 0 ? pw_term_negative (a) : a;
  FILE *to = emit_begin (e, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value * b.value, &out);
  fprintf (to, "%s * %s;\n", a.name, b.name);
  return out;
}

pw_term pw_emit_difference (pw_emitter *e, pw_term a, pw_term b, pw_term c) {
  pw_term out;
  char text[60];
  if (b.type == PW_TERM_ZERO || c.type == PW_TERM_ZERO) return a;
  if (a.type == PW_TERM_ZERO) return pw_term_negative (pw_emit_product (e, b, c));
  if (emit_is_constant (b) && emit_is_constant (c) && !emit_is_constant (a)) { /* the product once and for all */
    b = pw_emit_product (e, b, c);
    c = (pw_term){ PW_TERM_ONE, 1, "1", 1 };
  }
  int constant = emit_is_constant (a) && emit_is_constant (b) && emit_is_constant (c);
  if (b.type == PW_TERM_ONE || c.type == PW_TERM_ONE)
    snprintf (text, sizeof text, "%s", b.type == PW_TERM_ONE ? (c.type == PW_TERM_ONE ? "1" : c.name) : b.name);
  else
    snprintf (text, sizeof text, "%s * %s", b.name, c.name);
  FILE *to = emit_begin (e, constant, a.sign, a.value - b.value * c.value, &out);
  fprintf (to, "%s %c %s;\n", a.type == PW_TERM_ONE ? "1" : a.name, b.sign * c.sign * a.sign > 0 ? '-' : '+', text);
  return out;
}

pw_term pw_emit_quotient (pw_emitter *e, pw_term a, pw_term b) {
  pw_term out;
  if (b.type == PW_TERM_ONE) return b.sign < 0 ? pw_term_negative (a) : a;
  FILE *to = emit_begin (e, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value / b.value, &out);
  fprintf (to, "%s / %s;\n", a.type == PW_TERM_ONE ? "1" : a.name, b.name);
  return out;
}

void pw_emit_name (FILE *out, const char *name) {
  for (; *name; name++) fputc (isalnum ((unsigned char)*name) || strchr (" _-.[]()", *name) ? *name : '?', out);
}
