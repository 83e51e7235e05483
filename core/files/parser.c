/* Recursive-descent parser: converts the text of an expression to operations in postfix order.  { } repeats, [ ] is
 * optional:
 *
 *   choice   = binary [? choice : choice]
 *   binary   = unary {operator unary}           by precedence, left-associative
 *   unary    = + unary | - unary | operand [^ unary]
 *   operand  = number | name | function (choice, ...) | path.function (choice, ...) | (choice)
 *
 * Parts without variables are evaluated immediately.  Errors are reported at their position. */
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include "expression.h"
#include "files.h"

#define DIGITS "0123456789"

static int is_digit (char c) {
  return c >= '0' && c <= '9';
}

/* The length of the name at p, which may contain dots (frame.phi); 0 if there is none. */
static size_t name_size (const char *p) {
  size_t n = 0;
  for (char c = *p; (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || (n && (is_digit (c) || c == '.'));)
    c = p[++n];
  return n;
}

size_t pw_number_size (const char *p) {
  if (!is_digit (*p) && *p != '.') return 0;
  size_t whole = strspn (p, DIGITS), decimals = p[whole] == '.' ? strspn (p + whole + 1, DIGITS) : 0;
  if (whole + decimals == 0) return 0;
  const char *end = p + whole + (p[whole] == '.' ? 1 + decimals : 0); /* of the mantissa */
  if (*end != 'e' && *end != 'E') return (size_t)(end - p);
  const char *exponent = end + 1 + (end[1] == '+' || end[1] == '-');
  size_t digits = strspn (exponent, DIGITS);
  return (size_t)(digits ? exponent + digits - p : end - p);
}

char *pw_number_hint (const char *text, char *buffer, size_t size) {
  const size_t sign = *text == '+' || *text == '-', n = sign + pw_number_size (text + sign);
  const char *unit = text + n + strspn (text + n, " "), *factor = strcmp (unit, "pi") == 0 ? unit : NULL;
  char number[32];
  double value;
  *buffer = 0;
  if (n == sign || *unit == 0) return buffer;
  for (const pw_unit_name *u = pw_unit_names; u->name && !factor; u++)
    if (strcmp (u->name, unit) == 0) factor = u->factor;
  if (factor == NULL && pw_unit_factor (unit, NULL, &value) == PW_OK) factor = pw_format (number, value, 12);
  if (factor == NULL) return buffer;
  if (pw_expression_is_reserved (factor)) return pw_print (buffer, size, "; write %.*s*%s", (int)n, text, factor);
  const char *times = strcmp (factor, "1") == 0 ? "" : "*";
  return pw_print (buffer, size, "; write %.*s%s%s: numbers are in SI units", (int)n, text, times,
                   *times ? factor : "");
}

static int is_call (const char *after) {
  return after[strspn (after, " \t\r\n")] == '(';
}

int pw_expression_number (const char *text, double *value) {
  size_t sign = *text == '+' || *text == '-', n = pw_number_size (text + sign);
  return n && text[sign + n] == 0 && pw_read_number (text, value) == PW_OK;
}

int pw_expression_is_reserved (const char *text) {
  return pw_expression_find_function (text) >= 0;
}

int pw_expression_is_name (const char *text) {
  size_t n = name_size (text);
  return n && text[n] == 0 && n < 64 && strchr (text, '.') == NULL;
}

const char *pw_expression_next_word (const char **rest, char name[PW_EXPRESSION_NAME]) {
  while (**rest) {
    const char *p = *rest;
    size_t n = name_size (p), number = n ? 0 : pw_number_size (p);
    *rest += n ? n : number ? number : 1;
    if (n == 0) continue;
    pw_print_part (name, PW_EXPRESSION_NAME, p, n);
    return p;
  }
  return NULL;
}

const char *pw_expression_next_name (const char **rest, char name[PW_EXPRESSION_NAME]) {
  const char *p = pw_expression_next_word (rest, name);
  while (p && strchr (name, '.') && is_call (*rest)) p = pw_expression_next_word (rest, name);
  return p;
}

int pw_scope_reserve (pw_scope *s, int room, pw_arena *arena) {
  if (s->index.slot && room <= s->room) return PW_OK;
  size_t n = room > 2 * s->room ? (size_t)room + 1 : 2 * (size_t)s->room; /* never an empty allocation */
  const char **name;
  double *value;
  pw_path **path;
  if (!PW_ARENA_ARRAYS (arena, PW_ARRAY (name, n), PW_ARRAY (value, n), PW_ARRAY (path, n)) ||
      pw_names_reserve (&s->index, n) != PW_OK)
    return PW_RESOURCE;
  if (s->names) memcpy (name, s->name, (size_t)s->names * sizeof *name);
  if (s->names) memcpy (value, s->value, (size_t)s->names * sizeof *value);
  if (s->names) memcpy (path, s->path, (size_t)s->names * sizeof *path);
  s->name = name, s->value = value, s->path = path, s->room = (int)n;
  return PW_OK;
}

void pw_scope_close (pw_scope *s) {
  pw_names_close (&s->index);
}

void pw_scope_add (pw_scope *s, const char *name, double value) {
  s->name[s->names] = name;
  s->value[s->names] = value;
  pw_names_add (&s->index, name, s->names++);
}

void pw_scope_add_path (pw_scope *s, const char *name, pw_path *path) {
  s->path[s->names] = path;
  pw_scope_add (s, name, NAN);
}

pw_path *pw_scope_path (const pw_scope *s, const char *name) {
  const size_t n = strcspn (name, ".");
  if (s == NULL || name[n] == 0) return NULL;
  const int found = pw_names_find (&s->index, PW_PART (name, n));
  return found < 0 ? NULL : s->path[found];
}

enum { PARSER_MAX_LENGTH = 4000, PARSER_MAX_DEPTH = 200 };

/* What the value of a part depends on; variables other than the time are states. */
enum { DEPENDS_ON_TIME = 1, DEPENDS_ON_STATES = 2 };

typedef struct {
  const char *name;
  short op, precedence;
} parser_operator;

/* An operator that begins with another one comes before it; precedence 1 binds least. */
static const parser_operator parser_operators[] = {
  { "||", PW_OP_SELECT, 1 },        { "&&", PW_OP_SELECT, 2 },  { "<=", PW_OP_LESS_EQUAL, 3 },
  { ">=", PW_OP_GREATER_EQUAL, 3 }, { "==", PW_OP_EQUAL, 3 },   { "!=", PW_OP_UNEQUAL, 3 },
  { "<", PW_OP_LESS, 3 },           { ">", PW_OP_GREATER, 3 },  { "+", PW_OP_ADD, 4 },
  { "-", PW_OP_SUBTRACT, 4 },       { "*", PW_OP_MULTIPLY, 5 }, { "/", PW_OP_DIVIDE, 5 },
  { "^", PW_OP_POWER, 6 },          { .name = NULL },
};

typedef struct {
  const pw_scope *scope;
  const char *const *variable;
  const char *text;
  size_t at, size;               /* of the current token */
  size_t previous, previous_end; /* start and end of the token before it */
  char type;                     /* 'n' name, '0' number, 'o' operator, 0 the end; or ( ) , ? : itself */
  const parser_operator *symbol; /* of a token of type 'o'; else NULL */
  int depth, stacked;            /* of the recursion; operands on the stack during evaluation */
  pw_path *path;                 /* of the function of a path that is pushed next */
  int status;                    /* PW_OK until the first error */
  pw_expression_error *error;
  /* of the pw_expression being made */
  int breaks;
  pw_jumps jumps;
  const char *jump;
  int jump_size, unlocated;
  int codes;
  pw_expression_code code[PW_EXPRESSION_CODES];
} parser;

typedef struct {
  size_t from;   /* offset in the text */
  int first;     /* its first operation; its last one is the last of parser.code */
  int depends;   /* DEPENDS_ON_TIME | DEPENDS_ON_STATES */
  int condition; /* 1: its value is 1 or 0 */
} parser_part;

/* Records an error at an offset, unless there is one already.  Returns an empty part for the caller to return. */
PW_PRINTF (3, 4) static parser_part parser_fail (parser *p, size_t at, const char *format, ...) {
  if (p->status != PW_OK) return (parser_part){ 0 };
  p->status = PW_INPUT;
  p->error->at = at;
  va_list arguments;
  va_start (arguments, format);
  vsnprintf (p->error->text, sizeof p->error->text, format, arguments);
  va_end (arguments);
  return (parser_part){ 0 };
}

static void parser_next (parser *p) {
  const char *word = p->text + p->at + p->size;
  p->previous = p->at;
  p->previous_end = p->at + p->size;
  word += strspn (word, " \t\r\n");
  p->at = (size_t)(word - p->text);
  p->symbol = NULL;
  size_t name = name_size (word), number = pw_number_size (word);
  p->size = name ? name : number ? number : *word != 0;
  p->type = name ? 'n' : number ? '0' : *word;
  if (name || number || *word == 0 || strchr ("(),?:", *word)) return;
  for (const parser_operator *o = parser_operators; o->name && !p->symbol; o++)
    if (*word == *o->name && strncmp (word, o->name, strlen (o->name)) == 0) p->symbol = o;
  p->type = 'o';
  if (p->symbol == NULL && *word == '=')
    parser_fail (p, p->at, "\"=\" would assign; equality is written ==");
  else if (p->symbol == NULL && strncmp (word, "°", 2) == 0)
    parser_fail (p, p->at, "degrees are written *deg: 30*deg");
  else if (p->symbol == NULL)
    parser_fail (p, p->at, "%s does not belong in an expression",
                 *word & 0x80 ? "a non-ASCII character" : (char[]){ '"', *word, '"', 0 });
  else if (word[0] == '*' && word[1] == '*')
    parser_fail (p, p->at, "a power is written with ^");
  else
    p->size = strlen (p->symbol->name);
}

static void parser_push (parser *p, int op, int index, double value) {
  if (p->status != PW_OK) return;
  p->stacked += 1 - pw_expression_operands (op);
  if (p->stacked > PW_EXPRESSION_STACK || p->codes == PW_EXPRESSION_CODES)
    parser_fail (p, p->at, "the nesting is too deep here");
  else
    p->code[p->codes++] = (pw_expression_code){ (short)op, (short)index, { value } };
  if (p->status == PW_OK && pw_expression_has_path (op)) p->code[p->codes - 1].path = p->path;
}

/* A constant or variable, the current token. */
static parser_part parser_leaf (parser *p, int op, int index, double value) {
  parser_part part = { .from = p->at, .first = p->codes };
  if (op == PW_OP_VARIABLE) part.depends = index == PW_EXPRESSION_TIME ? DEPENDS_ON_TIME : DEPENDS_ON_STATES;
  parser_push (p, op, index, value);
  parser_next (p);
  return part;
}

/* Appends an operation on `part` and operands that depend on `depends`; a constant result is replaced by its value. */
static parser_part parser_operation (parser *p, parser_part part, int depends, int op, int index) {
  part.depends |= depends;
  part.condition = op >= PW_OP_LESS && op <= PW_OP_UNEQUAL;
  parser_push (p, op, index, 0);
  if (p->status != PW_OK) return part;
  if (part.depends == 0) {
    double value = pw_expression_run (p->code + part.first, p->codes - part.first, NULL, &(int){ 0 });
    p->codes = part.first + 1;
    p->code[part.first] = (pw_expression_code){ PW_OP_CONSTANT, 0, { value } };
  }
  if (pw_expression_breaks (op) && part.depends & DEPENDS_ON_TIME) p->breaks = 1;
  int at_one_point = op == PW_OP_EQUAL || op == PW_OP_UNEQUAL; /* jumps, and back at once */
  if (at_one_point || !(part.depends & DEPENDS_ON_STATES)) return part;
  const pw_jumps jumps = pw_expression_may_jump (p->code + part.first, p->codes - part.first);
  const int unlocated = jumps > PW_JUMPS_NEVER && (op == PW_OP_ATAN2 || pw_expression_has_path (op));
  if (unlocated > p->unlocated || (unlocated == p->unlocated && jumps > p->jumps)) {
    p->unlocated = unlocated;
    p->jump = p->text + part.from;
    p->jump_size = (int)(p->previous_end - part.from);
  }
  if (jumps > p->jumps) p->jumps = jumps;
  return part;
}

/* Converts a condition to 1 or 0. */
static parser_part parser_condition (parser *p, parser_part part) {
  if (part.condition) return part;
  parser_push (p, PW_OP_CONSTANT, 0, 0);
  return parser_operation (p, part, 0, PW_OP_UNEQUAL, 0);
}

static parser_part parser_choice (parser *p);

/* Whether the recursion may go deeper; the caller counts p->depth down again. */
static int parser_enter (parser *p) {
  if (++p->depth > PARSER_MAX_DEPTH)
    parser_fail (p, p->at, "%s", p->type == '(' ? "too many parentheses" : "the nesting is too deep here");
  return p->status == PW_OK;
}

static int parser_knows (const parser *p, const char *name) {
  int found = p->scope && pw_names_find (&p->scope->index, name) >= 0;
  for (const char *const *v = p->variable; v && *v; v++) found |= strcmp (*v, name) == 0;
  return found;
}

/* Reports an unexpected token after an operand; after a number, says what to write: "2*a", "30*deg". */
static parser_part parser_no_operator (parser *p) {
  char hint[PW_HINT] = "";
  const char *number = p->text + p->previous, *name = PW_PART (p->text + p->at, p->size);
  if (p->type == 'n' && pw_number_size (number) && parser_knows (p, name))
    pw_print (hint, sizeof hint, "; write %.*s*%s", (int)(p->previous_end - p->previous), number, name);
  else if (p->type == 'n' && *pw_number_hint (number, hint, sizeof hint) == 0) /* "10 km/h", else "30deg*a" */
    pw_number_hint (PW_PART (number, (size_t)(p->at + p->size - p->previous)), hint, sizeof hint);
  return parser_fail (p, p->at, "an operator such as * is missing before \"%c\"%s", p->text[p->at], hint);
}

/* Reports an unexpected token.  open: a '(' or '?' at offset `at` that is not complete; 0 if there is none. */
static parser_part parser_unexpected (parser *p, char open, size_t at) {
  if (p->type == 'n' || p->type == '0' || p->type == '(') return parser_no_operator (p);
  if (open == '?') return parser_fail (p, at, "there is no \":\" for this \"?\"");
  if (p->type == ',') return parser_fail (p, p->at, "a comma belongs between the arguments of a function");
  if (p->type == ')') return parser_fail (p, p->at, "there is no \"(\" for this \")\"");
  if (open && p->type == 0) return parser_fail (p, at, "there is no \")\" for this \"(\"");
  return parser_fail (p, p->at, "this does not belong here");
}

static parser_part parser_missing (parser *p) {
  if (p->status != PW_OK) return (parser_part){ 0 };
  if (p->type == 0 && p->previous_end == 0) return parser_fail (p, 0, "an expression is missing");
  if (p->type == 0 || (p->type == ')' && p->previous_end))
    return parser_fail (p, p->previous, "something is missing after \"%s\"",
                        PW_PART (p->text + p->previous, (size_t)(p->previous_end - p->previous)));
  return parser_fail (p, p->at, "this does not belong here");
}

static parser_part parser_unknown (parser *p, const char *name) {
  pw_nearest near = { .sought = name };
  for (const char *const *v = p->variable; v && *v; v++) pw_nearest_try (&near, *v);
  for (int i = 0; p->scope && i < p->scope->names; i++) pw_nearest_try (&near, p->scope->name[i]);
  for (const pw_expression_function *f = pw_expression_functions; f->name; f++) pw_nearest_try (&near, f->name);
  if (strcmp (name, "T") == 0) pw_nearest_try (&near, "t"); /* the time, defined in some expressions only */
  return parser_fail (p, p->at, "there is no \"%s\"%s", name, pw_nearest_text (&near));
}

static int parser_is_call (const parser *p) {
  return is_call (p->text + p->at + p->size);
}

/* Reads an expression in place of the current token, the name of it.  Errors are reported at the name. */
static parser_part parser_expand (parser *p, const char *name, const char *expanded) {
  const char *text = p->text;
  const size_t at = p->at, size = p->size;
  if (p->variable == NULL)
    return parser_fail (p, at, "\"%s\" changes during the motion, and this number must not", name);
  if (!parser_enter (p)) return (parser_part){ 0 };
  p->text = expanded, p->at = p->size = 0;
  parser_next (p);
  parser_part part = parser_choice (p);
  if (p->status == PW_OK && p->type != 0) parser_unexpected (p, 0, 0);
  p->depth--;
  p->text = text, p->at = part.from = at, p->size = size;
  if (p->status == PW_OK) return parser_next (p), part;
  if (p->status == PW_INPUT) {
    p->error->at = at;
    memcpy (p->error->text, PW_PRINTED (sizeof p->error->text, "in \"%.63s\": %s", name, p->error->text),
            sizeof p->error->text);
  }
  return (parser_part){ 0 };
}

/* constant: the constant of this name, or NULL; other names have precedence. */
static parser_part parser_name (parser *p, const char *name, const pw_expression_function *constant) {
  int variable = 0, named = p->scope ? pw_names_find (&p->scope->index, name) : -1;
  while (p->variable && p->variable[variable] && strcmp (p->variable[variable], name) != 0) variable++;
  int is_variable = p->variable && p->variable[variable];
  const char *expanded =
      !is_variable && p->scope && p->scope->expand ? p->scope->expand (p->scope->context, name) : NULL;
  if (!is_variable && named < 0 && constant == NULL && expanded == NULL) return parser_unknown (p, name);
  if (named >= 0 && p->scope->path[named])
    return parser_fail (p, p->at, "\"%s\" is a path: write %s.offset (x, y) or another function of it", name, name);
  if (parser_is_call (p))
    return parser_fail (p, p->at, "\"%s\" is a number, not a function; a product is written with *", name);
  if (is_variable) return parser_leaf (p, PW_OP_VARIABLE, variable, 0);
  if (expanded) return parser_expand (p, name, expanded);
  return parser_leaf (p, PW_OP_CONSTANT, 0, named >= 0 ? p->scope->value[named] : constant->value);
}

/* A function; min and max combine more than two arguments pairwise.  path: NULL, or that of which it is a function. */
static parser_part parser_call (parser *p, int index, pw_path *path) {
  const int needs_point = path && (index == PW_PATH_S || index == PW_PATH_OFFSET);
  const pw_expression_function *f = &pw_expression_functions[path ? 0 : index];
  const int least = path ? 1 + needs_point : f->least, most = path ? 3 : f->most;
  parser_part part = { .from = p->at, .first = p->codes };
  int arguments = 0;
  parser_next (p);
  size_t open = p->at;
  do {
    if (!parser_enter (p)) return part;
    parser_next (p);
    if (p->type == ')' && arguments == 0) break;
    const size_t at = p->at;
    int depends = parser_choice (p).depends;
    p->depth--;
    if (depends && path == NULL && arguments + 1 == f->constant)
      return parser_fail (p, at, "%s: this argument must be a constant", f->name);
    if (most == 0 && arguments) part = parser_operation (p, part, depends, f->op, index);
    part.depends |= depends, arguments++;
  } while (p->type == ',' && p->status == PW_OK);
  if (p->status != PW_OK) return part;
  if (p->type != ')') return parser_unexpected (p, '(', open);
  if (arguments < least)
    return parser_fail (p, p->at, "too few arguments%s",
                        needs_point ? "; the place nearest to a point needs x, y" : "");
  if (most && arguments > most) return parser_fail (p, p->at, "too many arguments");
  parser_next (p);
  if (path == NULL) return most ? parser_operation (p, part, part.depends, f->op, index) : part;
  p->path = path;
  if (arguments == 1) return parser_operation (p, part, part.depends, PW_OP_PATH_AT, index);
  if (arguments == 2) parser_push (p, PW_OP_CONSTANT, 0, INFINITY); /* pw_path_nearest: of all places */
  if (part.depends) part.depends |= DEPENDS_ON_STATES;              /* its jumps are not located */
  return parser_operation (p, part, part.depends, PW_OP_PATH_NEAREST, index);
}

/* A function of a path, PATH.FUNCTION. */
static parser_part parser_path (parser *p, const char *name) {
  const pw_scope *s = p->scope;
  const size_t n = strcspn (name, ".");
  const char *owner = PW_PART (name, n);
  char hint[PW_HINT];
  pw_path *path = pw_scope_path (s, name);
  if (pw_expression_find_function (name + n + 1) >= 0)
    return parser_fail (p, p->at, "functions are written without a module: %s", name + n + 1);
  if (path == NULL) {
    pw_nearest near = { .sought = owner };
    for (int i = 0; s && i < s->names; i++)
      if (s->path[i]) pw_nearest_try (&near, s->name[i]);
    return parser_fail (p, p->at, "there is no path \"%s\"%s", owner, pw_nearest_text (&near));
  }
  const int function = pw_find_name (pw_path_functions, sizeof *pw_path_functions, name + n + 1, hint);
  if (function < 0) return parser_fail (p, p->at + n + 1, "a path has no function \"%s\"%s", name + n + 1, hint);
  if (parser_is_call (p)) return parser_call (p, function, path);
  return parser_fail (p, p->at, "%s is a function: write its arguments in parentheses, such as (%s)", name,
                      function == PW_PATH_S || function == PW_PATH_OFFSET ? "x, y" : "s");
}

static parser_part parser_group (parser *p) {
  size_t open = p->at;
  if (!parser_enter (p)) return (parser_part){ 0 };
  parser_next (p);
  parser_part part = parser_choice (p);
  p->depth--;
  part.from = open;
  if (p->status != PW_OK) return part;
  if (p->type != ')') return parser_unexpected (p, '(', open);
  parser_next (p);
  return part;
}

static parser_part parser_operand (parser *p) {
  if (p->status != PW_OK) return (parser_part){ 0 };
  if (p->type == '0') {
    double value = 0;
    char digits[PARSER_MAX_LENGTH + 1];
    pw_print_part (digits, sizeof digits, p->text + p->at, p->size);
    if (pw_read_number (digits, &value) != PW_OK) p->status = PW_RESOURCE;
    return parser_leaf (p, PW_OP_CONSTANT, 0, value);
  }
  if (p->type == '(') return parser_group (p);
  if (p->type != 'n') return parser_missing (p);
  const char *name = pw_print_part ((char[PW_EXPRESSION_NAME]){ 0 }, PW_EXPRESSION_NAME, p->text + p->at, p->size);
  if (strchr (name, '.') && (parser_is_call (p) || pw_scope_path (p->scope, name))) return parser_path (p, name);
  int index = pw_expression_find_function (name);
  const pw_expression_function *f = index < 0 ? NULL : &pw_expression_functions[index];
  if (f == NULL || f->op == PW_OP_CONSTANT) return parser_name (p, name, f);
  if (parser_is_call (p)) return parser_call (p, index, NULL);
  return parser_fail (p, p->at, "\"%s\" is a function: write its argument in parentheses", name);
}

static parser_part parser_unary (parser *p) {
  parser_part part = { .from = p->at, .first = p->codes };
  int op = p->symbol ? p->symbol->op : 0;
  int sign = op == PW_OP_ADD || op == PW_OP_SUBTRACT;
  if (!sign) part = parser_operand (p);
  if (!sign && (p->symbol == NULL || p->symbol->op != PW_OP_POWER)) return part;
  if (!parser_enter (p)) return part;
  parser_next (p);
  part.depends |= parser_unary (p).depends;
  p->depth--;
  if (op == PW_OP_ADD) return part;
  return parser_operation (p, part, part.depends, sign ? PW_OP_NEGATE : PW_OP_POWER, 0);
}

static parser_part parser_binary (parser *p, int precedence) {
  parser_part part = parser_unary (p);
  while (p->status == PW_OK && p->symbol && p->symbol->precedence >= precedence) {
    const parser_operator *o = p->symbol;
    int logical = o->op == PW_OP_SELECT;
    if (logical) part = parser_condition (p, part);
    if (logical && *o->name == '|') parser_push (p, PW_OP_CONSTANT, 0, 1);
    parser_next (p);
    parser_part right = parser_binary (p, o->precedence + 1);
    if (logical) right = parser_condition (p, right);
    if (logical && *o->name == '&') parser_push (p, PW_OP_CONSTANT, 0, 0);
    part = parser_operation (p, part, right.depends, o->op, 0);
    part.condition |= logical;
  }
  return part;
}

static parser_part parser_choice (parser *p) {
  parser_part part = parser_binary (p, 1);
  size_t question = p->at;
  if (p->status != PW_OK || p->type != '?' || !parser_enter (p)) return part;
  part = parser_condition (p, part);
  parser_next (p);
  int depends = parser_choice (p).depends;
  if (p->status == PW_OK && p->type != ':') return parser_unexpected (p, '?', question);
  parser_next (p);
  depends |= parser_choice (p).depends;
  p->depth--;
  return parser_operation (p, part, depends, PW_OP_SELECT, 0);
}

static int parser_read (parser *p, const pw_scope *s, const char *const *variable, const char *text,
                        pw_expression_error *error) {
  memset (p, 0, offsetof (parser, code));
  p->scope = s, p->variable = variable, p->text = text, p->error = error;
  error->at = 0;
  if (strlen (text) > PARSER_MAX_LENGTH)
    return parser_fail (p, 0, "an expression of more than %d characters", PARSER_MAX_LENGTH), p->status;
  parser_next (p);
  parser_choice (p);
  if (p->status == PW_OK && p->type != 0) parser_unexpected (p, 0, 0);
  return p->status;
}

size_t pw_expression_size (const pw_expression *x) {
  return sizeof *x + (size_t)x->codes * sizeof *x->code;
}

void pw_expression_share_paths (const pw_expression *x) {
  for (int i = 0; i < x->codes; i++)
    if (pw_expression_has_path (x->code[i].op)) pw_path_share (x->code[i].path);
}

void pw_expression_release_paths (const pw_expression *x) {
  for (int i = 0; i < x->codes; i++)
    if (pw_expression_has_path (x->code[i].op)) pw_path_close (x->code[i].path);
}

int pw_expression_read (const pw_scope *s, const char *const *variable, const char *text, pw_arena *arena,
                        const pw_expression **x, pw_expression_error *error) {
  parser p;
  if (parser_read (&p, s, variable, text, error) != PW_OK) return p.status;
  pw_expression head = { p.codes, p.breaks, p.jumps, p.jump, p.jump_size, p.unlocated },
                *copy = pw_arena_alloc (arena, pw_expression_size (&head));
  if (copy == NULL) return PW_RESOURCE;
  *copy = head;
  memcpy (copy->code, p.code, (size_t)p.codes * sizeof *p.code);
  *x = copy;
  return PW_OK;
}

int pw_expression_constant (const pw_scope *s, const char *const *variable, const double *values, const char *text,
                            double *value, pw_expression_error *error) {
  parser p;
  if (pw_expression_number (text, value)) return PW_OK;
  if (parser_read (&p, s, variable, text, error) == PW_OK)
    *value = pw_expression_run (p.code, p.codes, values, &(int){ 0 });
  return p.status;
}

int pw_read_expression (const char *text, double *value) {
  pw_expression_error error;
  if (pw_read_number (text, value) == PW_OK) return PW_OK;
  return pw_expression_constant (NULL, NULL, NULL, text, value, &error);
}

/* ---- Formulas: expressions of named numbers, none of which is the time ---- */

struct pw_formula {
  pw_arena arena;
  const pw_expression *expression;
};

pw_formula *pw_formula_open (const char *text, const char *const *names, pw_error *error) {
  pw_expression_error why;
  int status = PW_RESOURCE, count = 0;
  if (pw_require (text, "an expression", error) != PW_OK || pw_require (names, "the list of names", error) != PW_OK)
    return NULL;
  while (names[count]) count++;
  if (count > PW_FORMULA_NAMES) {
    pw_fail (error, PW_INPUT, "more than %d names", PW_FORMULA_NAMES);
    return NULL;
  }
  pw_formula *f = calloc (1, sizeof *f);
  if (f) status = pw_expression_read (NULL, names, text, &f->arena, &f->expression, &why);
  if (status == PW_OK) return f;
  pw_fail (error, status, "%s", status == PW_INPUT ? why.text : "out of memory");
  pw_formula_close (f);
  return NULL;
}

double pw_formula_value (const pw_formula *f, const double *value) {
  /* jumps do not matter: without a time, there is no value just after one */
  return pw_expression_run (f->expression->code, f->expression->codes, value, &(int){ 0 });
}

void pw_formula_close (pw_formula *f) {
  if (f) pw_arena_free (&f->arena);
  free (f);
}

/* ---- Conditions ---- */

struct pw_condition {
  pw_arena arena;
  const pw_expression *expression;
  pw_workspace *workspace;
  pw_column column[PW_FORMULA_NAMES]; /* names of the expression */
  int columns, needs_ledger;
};

/* How far an operation's result is from changing its truth, > 0 if it is true; left, right: values of its operands. */
static double condition_margin (int op, double value, double left, double right) {
  const double difference = left - right;
  switch (op) {
  case PW_OP_LESS:
    return -difference;
  case PW_OP_GREATER:
    return difference;
  case PW_OP_LESS_EQUAL:
    return difference <= 0 ? fmax (-difference, DBL_MIN) : -difference;
  case PW_OP_GREATER_EQUAL:
    return difference >= 0 ? fmax (difference, DBL_MIN) : difference;
  default:
    return value != 0 ? DBL_MAX : -DBL_MAX; /* a number, which is true unless it is 0 */
  }
}

double pw_condition_value (void *condition, const pw_sample *x) {
  const pw_condition *c = condition;
  double variable[PW_FORMULA_NAMES], value[PW_EXPRESSION_STACK], margin[PW_EXPRESSION_STACK];
  int n = 0;
  if (pw_workspace_columns (c->workspace, x, c->column, c->columns, variable, NULL) != PW_OK) return NAN;
  for (const pw_expression_code *o = c->expression->code, *end = o + c->expression->codes; o < end; o++) {
    const int operands = pw_expression_operands (o->op);
    n -= operands;
    if (o->op == PW_OP_SELECT) {
      margin[n] = margin[n + 1] == DBL_MAX ? fmax (margin[n], margin[n + 2]) /* a || b */
                                           : fmax (fmin (margin[n], margin[n + 1]), fmin (-margin[n], margin[n + 2]));
      value[n] = value[n] != 0 ? value[n + 1] : value[n + 2];
    } else {
      const double left = operands > 0 ? value[n] : 0, right = operands > 1 ? value[n + 1] : left;
      value[n] = o->op == PW_OP_CONSTANT   ? o->value
                 : o->op == PW_OP_VARIABLE ? variable[o->index]
                                           : pw_expression_apply (o, left, right);
      margin[n] = condition_margin (o->op, value[n], left, right);
    }
    n++;
  }
  return margin[0];
}

/* Finds the columns that the names of the text name, except functions and constants. */
static int condition_columns (pw_condition *c, const pw_system *s, const char *text, const char **names,
                              pw_error *error) {
  char name[PW_EXPRESSION_NAME];
  for (const char *rest = text, *at; (at = pw_expression_next_name (&rest, name)) != NULL;) {
    int i = 0;
    if (pw_expression_is_reserved (name)) continue;
    while (at > text && at[-1] == ' ') at--;
    if (at > text && strchr (".0123456789", at[-1]))
      return pw_fail (error, PW_INPUT,
                      "\"%s\" after a number: write it without a unit, in SI units, angles in rad or as 90*deg", name);
    while (i < c->columns && strcmp (names[i], name) != 0) i++;
    if (i < c->columns) continue;
    if (i == PW_FORMULA_NAMES) return pw_fail (error, PW_INPUT, "more than %d columns", PW_FORMULA_NAMES);
    if (pw_system_find_column (s, name, &c->column[i], error) != PW_OK) return PW_INPUT;
    const pw_column_type type = c->column[i].type;
    c->needs_ledger |= type > PW_COLUMN_POTENTIAL && type < PW_COLUMN_OUTPUT;
    if ((names[i] = pw_arena_copy (&c->arena, name)) == NULL) return pw_fail (error, PW_RESOURCE, "out of memory");
    c->columns++;
  }
  return PW_OK;
}

static int condition_read (pw_condition *c, const pw_system *s, const char *text, pw_error *error) {
  const char *names[PW_FORMULA_NAMES + 1] = { NULL };
  static const char equal[] = "an equality holds at an instant only, which no step meets; use <= or >=";
  pw_expression_error why;
  for (const char *p = text; (p = strchr (p, '=')) != NULL; p++)
    if (p[1] != '=' && (p == text || strchr ("<>!=", p[-1]) == NULL)) return pw_fail (error, PW_INPUT, equal);
  if (condition_columns (c, s, text, names, error) != PW_OK) return error->status;
  int status = pw_expression_read (NULL, names, text, &c->arena, &c->expression, &why);
  if (status != PW_OK) return pw_fail (error, status, "%s", status == PW_INPUT ? why.text : "out of memory");
  const int last = c->expression->code[c->expression->codes - 1].op;
  for (int i = 0; i < c->expression->codes; i++)
    if (c->expression->code[i].op == PW_OP_EQUAL) return pw_fail (error, PW_INPUT, equal);
  if (last == PW_OP_SELECT || (last >= PW_OP_LESS && last <= PW_OP_GREATER_EQUAL)) return PW_OK;
  return pw_fail (error, PW_INPUT, "expected a condition, such as \"car.x > 10\"");
}

pw_condition *pw_condition_open (const pw_system *s, const char *text, pw_error *error) {
  pw_error own = { 0 };
  if (pw_require (s, "a system", error) != PW_OK || pw_require (text, "a condition", error) != PW_OK) return NULL;
  pw_condition *c = calloc (1, sizeof *c);
  if (c) c->workspace = pw_workspace_new (s, &own);
  if (c && c->workspace && condition_read (c, s, text, &own) == PW_OK) return c;
  pw_condition_close (c);
  return pw_fail (error, own.status ? own.status : PW_RESOURCE, "%s", own.status ? own.text : "out of memory"), NULL;
}

int pw_condition_needs_ledger (const pw_condition *c) {
  return c->needs_ledger;
}

void pw_condition_close (pw_condition *c) {
  if (c == NULL) return;
  pw_workspace_free (c->workspace);
  pw_arena_free (&c->arena);
  free (c);
}
