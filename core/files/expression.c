/* Expressions by muParser.
 *
 * muParser 2.3.3 takes more than Pinwheel wants: assignments, lists of values, texts, a pi of 13 digits; and its messages
 * go through a buffer all threads share.  So an expression is first read word by word (expression_read.c), and what is
 * left to muParser is syntax, of which it tells the place. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <muParserDLL.h>
#include "expression_parts.h"
#include "pinwheel.h"
#include "pinwheel-files.h"

enum { EXPRESSION_LONGEST = 4000 }; /* muParser stops at 5000 */

struct pw_expression {
  muParserHandle_t parser;
  pw_expression_scope scope;
  struct {
    const char *text; /* NULL: nothing is kept here */
    double value;
  } kept[256]; /* by a hash of the text */
};

/* muParser throws when it is refused memory, and not only where C is spared of it: it is called when there is enough.
 * What it catches itself becomes an error of some kind, or none. */
enum { EXPRESSION_RESERVE = 1 << 16, EXPRESSION_RESERVE_NAME = 1 << 12, EXPRESSION_RESERVE_BYTE = 1 << 10 };

pw_expression *pw_expression_open (int names) {
  pw_expression *x = calloc (1, sizeof *x);
  if (x == NULL || pw_reserve (EXPRESSION_RESERVE) != PW_OK) {
    free (x);
    return NULL;
  }
  errno = 0;
  x->scope.room = names;
  x->scope.name = calloc ((size_t)names + 1, sizeof *x->scope.name);
  x->parser = mupCreate (muBASETYPE_FLOAT);
  if (x->scope.name == NULL || x->parser == NULL || pw_names_open (&x->scope.table, (size_t)names + 1) != PW_OK) {
    pw_expression_close (x);
    return NULL;
  }
  mupClearConst (x->parser);
  mupClearFun (x->parser);
  mupDefineNameChars (x->parser, "0123456789_abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.");
  for (const pw_expression_constant *c = pw_expression_constants; c->name; c++)
    mupDefineConst (x->parser, c->name, c->value);
  for (const pw_expression_function *f = pw_expression_functions; f->name; f++) {
    if (f->one) mupDefineFun1 (x->parser, f->name, f->one, 1);
    if (f->two) mupDefineFun2 (x->parser, f->name, f->two, 1);
    if (f->many) mupDefineMultFun (x->parser, f->name, f->many, 1);
  }
  if (errno != ENOMEM) return x;
  pw_expression_close (x);
  return NULL;
}

void pw_expression_close (pw_expression *x) {
  if (x == NULL) return;
  if (x->parser) mupRelease (x->parser);
  pw_names_close (&x->scope.table);
  free (x->scope.name);
  free (x);
}

int pw_expression_name (pw_expression *x, const char *name, const double *value) {
  if (x->scope.names == x->scope.room || pw_reserve (EXPRESSION_RESERVE_NAME) != PW_OK) return PW_MACHINE;
  errno = 0;
  x->scope.name[x->scope.names] = name;
  pw_names_add (&x->scope.table, name, x->scope.names++);
  mupDefineVar (x->parser, name, (double *)(size_t)value);
  int failed = mupError (x->parser) || errno == ENOMEM;
  mupErrorReset (x->parser);
  return failed ? PW_MACHINE : PW_OK;
}

/* Where muParser stopped; without its messages, which pass through a buffer that threads share. */
static int expression_stopped (const pw_expression *x, const char *text, pw_expression_trouble *trouble) {
  enum { TOO_MANY = 14, TOO_FEW = 15 }; /* ecTOO_MANY_PARAMS, ecTOO_FEW_PARAMS of muParserError.h */
  int code = mupGetErrorCode (x->parser), at = mupGetErrorPos (x->parser);
  size_t n = strlen (text), place = at < 0 ? 0 : (size_t)at < n ? (size_t)at : n ? n - 1 : 0;
  const char *why = code == TOO_MANY  ? "too many arguments"
                    : code == TOO_FEW ? "too few arguments"
                                      : "this does not belong here";
  return pw_expression_wrong (trouble, place, "%s%s", why, "");
}

int pw_expression_set (pw_expression *x, const char *text, pw_expression_trouble *trouble) {
  if (strlen (text) > EXPRESSION_LONGEST)
    return pw_expression_wrong (trouble, 0, "an expression of more than 4000 characters%s%s", "", "");
  if (pw_expression_read (&x->scope, text, trouble) != PW_OK) return PW_INPUT;
  if (pw_reserve (EXPRESSION_RESERVE + EXPRESSION_RESERVE_BYTE * strlen (text)) != PW_OK) return PW_MACHINE;
  errno = 0;
  mupErrorReset (x->parser);
  mupSetExpr (x->parser, text);
  if (!mupError (x->parser)) mupEval (x->parser);
  if (errno == ENOMEM) return PW_MACHINE;
  return mupError (x->parser) ? expression_stopped (x, text, trouble) : PW_OK;
}

double pw_expression_value (pw_expression *x) {
  return mupEval (x->parser);
}

int pw_expression_fixed (pw_expression *x, const char *text, double *value, pw_expression_trouble *trouble) {
  unsigned h = 0;
  for (const char *p = text; *p; p++) h = 31 * h + (unsigned char)*p;
  h = (h ^ h >> 8 ^ h >> 16) & 255;
  if (x->kept[h].text == NULL || strcmp (x->kept[h].text, text) != 0) {
    int status = pw_expression_set (x, text, trouble);
    if (status != PW_OK) return status;
    x->kept[h].text = text;
    x->kept[h].value = pw_expression_value (x);
  }
  *value = x->kept[h].value;
  return PW_OK;
}

int pw_read_expression (const char *text, double *value) {
  pw_expression_trouble trouble;
  if (pw_read_number (text, value) == PW_OK) return PW_OK;
  pw_expression *x = pw_expression_open (0);
  int status = x ? pw_expression_set (x, text, &trouble) : PW_MACHINE;
  if (status == PW_OK) *value = pw_expression_value (x);
  pw_expression_close (x);
  return status;
}
