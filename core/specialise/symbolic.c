/* Terms of generated code; see symbolic.h. */
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

/* The term sign (a op b): a new variable or constant. */
static pw_term emit_define (pw_emitter *emitter, int constant, int sign, double value, const char *a, char op,
                            const char *b) {
  pw_term out = { constant ? PW_TERM_CONSTANT : PW_TERM_VARIABLE, sign, "", value };
  if (constant)
    snprintf (out.name, sizeof out.name, "C[%d]", emitter->constants++);
  else
    snprintf (out.name, sizeof out.name, "x%d", emitter->variables++);
  fprintf (constant ? emitter->prepare : emitter->code, "  %s%s = %s %c %s;\n", constant ? "" : "const double ",
           out.name, a, op, b);
  return out;
}

static int emit_is_constant (pw_term a) {
  return a.type != PW_TERM_VARIABLE;
}

pw_term pw_emit_product (pw_emitter *emitter, pw_term a, pw_term b) {
  if (a.type == PW_TERM_ZERO || b.type == PW_TERM_ZERO) return pw_term_zero ();
  if (a.type == PW_TERM_ONE) return a.sign < 0 ? pw_term_negative (b) : b;
  if (b.type == PW_TERM_ONE) return b.sign < 0 ? pw_term_negative (a) : a;
  return emit_define (emitter, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value * b.value, a.name,
                      '*', b.name);
}

pw_term pw_emit_difference (pw_emitter *emitter, pw_term a, pw_term b, pw_term c) {
  char text[60];
  if (b.type == PW_TERM_ZERO || c.type == PW_TERM_ZERO) return a;
  if (a.type == PW_TERM_ZERO) return pw_term_negative (pw_emit_product (emitter, b, c));
  if (emit_is_constant (b) && emit_is_constant (c) && !emit_is_constant (a)) { /* the product once and for all */
    b = pw_emit_product (emitter, b, c);
    c = (pw_term){ PW_TERM_ONE, 1, "1", 1 };
  }
  int constant = emit_is_constant (a) && emit_is_constant (b) && emit_is_constant (c);
  const char *left = b.type == PW_TERM_ONE ? "" : b.name, *right = c.type == PW_TERM_ONE && *left ? "" : c.name;
  snprintf (text, sizeof text, "%s%s%s", left, *left && *right ? " * " : "", right);
  return emit_define (emitter, constant, a.sign, a.value - b.value * c.value, a.name,
                      b.sign * c.sign * a.sign > 0 ? '-' : '+', text);
}

pw_term pw_emit_quotient (pw_emitter *emitter, pw_term a, pw_term b) {
  if (b.type == PW_TERM_ONE) return b.sign < 0 ? pw_term_negative (a) : a;
  return emit_define (emitter, emit_is_constant (a) && emit_is_constant (b), a.sign * b.sign, a.value / b.value, a.name,
                      '/', b.name);
}
