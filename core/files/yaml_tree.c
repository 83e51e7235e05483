/* Builds a tree from libfyaml's events.  It takes a third of the memory of libfyaml's tree, avoids its quadratic search
 * for duplicate keys, and reports anything a model file must not contain at its position. */
#include <errno.h>
#include <libfyaml.h>
#include <string.h>
#include "yaml.h"

enum { TREE_PIECE = 4096 }; /* bytes given to the parser at once */

typedef struct {
  pw_yaml *y; /* receives the nodes */
  pw_error *error;
  struct fy_parser *parser;
  struct fy_diag *diag;
  struct fy_token_iter *pieces;  /* iterates over the pieces of a scalar */
  pw_node *open[PW_YAML_DEPTH];  /* open lists and maps */
  pw_node **tail[PW_YAML_DEPTH]; /* where the next node of each goes */
  int depth;
  size_t fed;        /* bytes given to the parser */
  double indicators; /* [ ] { } , : given since the last event */
  double opened;     /* opening minus closing brackets among them */
  /* the last position converted */
  int line, column; /* from 0 */
  size_t offset;
  unsigned at; /* of the last node, for events without a position, and for the limits of tree_feed */
} tree;

/* The offset of a mark, computed from its line and its column (in characters): the offsets of libfyaml 0.7.12 are wrong
 * if the input is read in pieces.  Starts from the last mark: marks are nearly in order. */
static unsigned tree_offset_of (tree *x, const struct fy_mark *mark) {
  const char *source = x->y->source, *end = source + x->y->size, *p = source + x->offset;
  if (x->line != mark->line) {
    for (; x->line < mark->line && p < end; p++) x->line += *p == '\n';
    for (; p > source && (x->line > mark->line || p[-1] != '\n'); p--) x->line -= p[-1] == '\n';
    x->column = 0;
  }
  for (; x->column < mark->column && p < end && *p != '\n'; x->column++) p += pw_utf8_size (p);
  for (; x->column > mark->column && p > source; x->column--)
    for (p--; p > source && (*p & 0xC0) == 0x80;) p--;
  x->offset = (size_t)(p - source);
  return (unsigned)x->offset;
}

static unsigned tree_event_offset (tree *x, struct fy_event *e) {
  const struct fy_mark *mark = fy_event_start_mark (e);
  return mark && mark->line >= 0 ? tree_offset_of (x, mark) : x->at;
}

static pw_node *tree_add (tree *x, pw_yaml_type type, unsigned at) {
  pw_node *n = pw_arena_alloc (&x->y->arena, sizeof *n);
  if (n == NULL) return pw_yaml_no_memory (x->y, x->error), NULL;
  n->type = (unsigned char)type;
  n->at = x->at = at;
  if (x->depth == 0) {
    x->y->root = n;
    return n;
  }
  *x->tail[x->depth - 1] = n;
  x->tail[x->depth - 1] = &n->next;
  x->open[x->depth - 1]->count++;
  return n;
}

/* Joins the pieces of a scalar, unless `to` is NULL; returns their size, or -1 if out of memory.  (fy_token_get_text of
 * libfyaml 0.7.12 leaks 4 KB for every text of more than about ten pieces: escapes, lines.) */
static long tree_text (tree *x, struct fy_token *token, char *to) {
  const struct fy_iter_chunk *piece = NULL;
  long size = 0;
  int error = 0;
  if (token == NULL) return 0;
  fy_token_iter_start (token, x->pieces);
  while ((piece = fy_token_iter_chunk_next (x->pieces, piece, &error)) != NULL) {
    if (to) memcpy (to + size, piece->str, piece->len);
    size += (long)piece->len;
  }
  fy_token_iter_finish (x->pieces);
  return error ? -1 : size;
}

static void tree_scalar (tree *x, struct fy_event *e) {
  struct fy_token *token = e->scalar.value;
  int quoted = token && (fy_token_scalar_style (token) == FYSS_SINGLE_QUOTED ||
                         fy_token_scalar_style (token) == FYSS_DOUBLE_QUOTED);
  unsigned at = tree_event_offset (x, e);
  long size = tree_text (x, token, NULL);
  pw_node *n = tree_add (x, PW_YAML_SCALAR, at - (quoted && at > 0));
  char *text = n && size >= 0 ? pw_arena_alloc (&x->y->arena, (size_t)size + 1) : NULL;
  if (text == NULL || tree_text (x, token, text) != size) {
    pw_yaml_no_memory (x->y, x->error);
    return;
  }
  if (memchr (text, 0, (size_t)size)) pw_yaml_fail (x->y, x->error, n->at, "a text must not contain the character 0");
  for (const char *p = text; *p && x->error->status == PW_OK; p++) /* possible through escapes */
    if (pw_control (p))
      pw_yaml_fail (x->y, x->error, n->at, "a text must not contain the control character of code %d", pw_control (p));
  n->text = text;
  n->quoted = quoted || (token && fy_token_scalar_style (token) != FYSS_PLAIN);
}

static void tree_begin (tree *x, struct fy_event *e, pw_yaml_type type) {
  unsigned at = tree_event_offset (x, e);
  if (x->depth == PW_YAML_DEPTH) pw_yaml_fail (x->y, x->error, at, "nested too deeply");
  pw_node *n = x->depth < PW_YAML_DEPTH ? tree_add (x, type, at) : NULL;
  if (n == NULL) return;
  x->open[x->depth] = n;
  x->tail[x->depth++] = &n->first;
}

static int tree_refuse_anchor (tree *x, struct fy_event *e) {
  struct fy_token *anchor = fy_event_get_anchor_token (e), *tag = fy_event_get_tag_token (e);
  struct fy_token *token = e->type == FYET_ALIAS ? e->alias.anchor : anchor ? anchor : tag;
  if (token == NULL) return PW_OK;
  const struct fy_mark *mark = fy_token_start_mark (token);
  size_t at = mark && mark->line >= 0 ? tree_offset_of (x, mark) : tree_event_offset (x, e);
  const char *source = x->y->source;
  while (at > 0 && !strchr ("&*!", source[at]) && source[at - 1] != '\n') at--; /* a mark may be that of the name */
  return pw_yaml_fail (x->y, x->error, at, "%s do not belong in a model file; use parameters",
                       e->type == FYET_ALIAS ? "aliases (*)"
                       : anchor              ? "anchors (&)"
                                             : "tags (!)");
}

/* libfyaml cannot tell a list or map in brackets from a key before it has seen what follows the closing bracket, and
 * until then keeps some 350 bytes for each indicator.  So it receives the source in pieces, and none after too many
 * indicators without an event, or too many open brackets. */
enum { TREE_NESTED = 10000 };

static ssize_t tree_feed (void *user, void *to, size_t count) {
  tree *x = user;
  const char *piece = x->y->source + x->fed;
  size_t rest = x->y->size - x->fed, n = count < rest ? count : rest;
  if (n > TREE_PIECE) n = TREE_PIECE;
  memcpy (to, piece, n);
  x->fed += n;
  for (const char *p = piece; p < piece + n; p++) {
    int opens = *p == '[' || *p == '{', closes = *p == ']' || *p == '}';
    x->opened += opens - closes;
    x->indicators += opens || closes || *p == ',' || *p == ':';
  }
  if (x->opened > TREE_NESTED) pw_yaml_fail (x->y, x->error, x->at, "nested too deeply");
  if (x->indicators > x->y->max_ahead)
    pw_yaml_fail (x->y, x->error, x->at,
                  "a list or map in brackets with more than %g commas, colons and brackets, which takes much memory: "
                  "write its entries on separate lines, after \"- \" or \"key: \"",
                  x->y->max_ahead);
  return x->error->status == PW_OK ? (ssize_t)n : 0; /* libfyaml 0.7.12 retries after an error */
}

static void tree_event (tree *x, struct fy_event *e) {
  if (tree_refuse_anchor (x, e) != PW_OK) return;
  x->indicators = x->opened = 0;
  if (e->type == FYET_DOCUMENT_START && x->y->root)
    pw_yaml_fail (x->y, x->error, tree_event_offset (x, e), "a second document; a file contains one model");
  if (e->type == FYET_SCALAR) tree_scalar (x, e);
  if (e->type == FYET_SEQUENCE_START) tree_begin (x, e, PW_YAML_LIST);
  if (e->type == FYET_MAPPING_START) tree_begin (x, e, PW_YAML_MAP);
  if (e->type == FYET_MAPPING_END) x->open[x->depth - 1]->count /= 2;
  if (e->type == FYET_MAPPING_END || e->type == FYET_SEQUENCE_END) x->depth--;
}

/* A hint for a frequent mistake, from the line and the message of libfyaml, or "". */
static const char *tree_hint (const pw_yaml *y, size_t at, const char *message) {
  static const struct {
    const char *message, *hint;
  } known[] = { { "missing comma", "; or a } or ] before it" },
                { "nested block mapping", "; a text with \": \" in it goes between double quotes" },
                { "multiline plain key", "; the keys of a map begin in the same column" },
                { "indendation" /* as libfyaml spells it */, "; what belongs together begins in the same column" },
                { "indented", "; what belongs together begins in the same column" } };
  size_t begin = at < y->size ? at : y->size, size;
  while (begin > 0 && y->source[begin - 1] != '\n') begin--;
  begin += strspn (y->source + begin, " ");
  size = strcspn (y->source + begin, "\n");
  const char *line = y->source + begin, *slashes = strstr (line, " //");
  if (size > 1 && line[0] == '-' && strchr ("- 0123456789.", line[1]) == NULL) return "; a space goes after the -";
  if (slashes && slashes < line + size) return "; a comment begins with #";
  if (strstr (message, "missing comma") && memchr (line, '?', size))
    return "; an expression with ? : goes between double quotes";
  for (size_t i = 1; strstr (message, "missing comma") && i < size; i++)
    if (line[i] == '{' && strchr (" {[", line[i - 1]) == NULL) return "; a text with braces goes between double quotes";
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (strstr (message, known[i].message)) return known[i].hint;
  return "";
}

/* Reports the first syntax error; that of a list or map which is not closed, at its opening bracket. */
static int tree_syntax (tree *x) {
  void *first = NULL;
  struct fy_diag_error *e = fy_diag_errors_iterate (x->diag, &first);
  if (e == NULL) return pw_yaml_fail (x->y, x->error, x->at, "this is not YAML");
  const char *source = x->y->source;
  size_t at = tree_offset_of (x, &(struct fy_mark){ .line = e->line - 1, .column = e->column - 1 });
  if (at + strspn (source + at, " \t\r\n") == x->y->size && x->depth > 0) {
    size_t begin = x->open[x->depth - 1]->at;
    if (source[begin] == '[' || source[begin] == '{') at = begin;
  }
  const char *message = e->msg ? e->msg : "this is not YAML";
  return pw_yaml_fail (x->y, x->error, at, "%s%s", message, tree_hint (x->y, at, message));
}

/* Out of memory, libfyaml reports a syntax error, drops a part of the text, or crashes when it opens. */
enum { TREE_RESERVE = 1 << 16 };

/* Checks the source from y->begin on: UTF-8, no control characters, no lines that begin with %: some of these hang
 * libfyaml 0.7.12. */
static int tree_check_source (const pw_yaml *y, pw_error *error) {
  const char *begin = y->source, *p = begin + y->begin, *end = begin + y->size;
  while (p < end) {
    size_t at = (size_t)(p - begin);
    int n = pw_utf8_size (p);
    if (n == 0)
      return pw_yaml_fail (y, error, at, "byte %02X is not UTF-8; a model file is text in UTF-8", (unsigned char)*p);
    if ((*p == 0 || pw_control (p)) && !(*p == '\r' && p[1] == '\n'))
      return pw_yaml_fail (y, error, at, "a control character, code %d, does not belong in a model file",
                           pw_control (p));
    if (*p == '%' && (at == 0 || p[-1] == '\n'))
      return pw_yaml_fail (y, error, at, "a line of a model file must not begin with %%");
    p += n;
  }
  return PW_OK;
}

int pw_yaml_read_tree (pw_yaml *y, pw_error *error) {
  pw_error cause = { 0 };
  if (tree_check_source (y, error) != PW_OK) return error->status;
  struct fy_diag_cfg quiet;
  struct fy_event *e;
  tree x = { .y = y, .error = &cause, .fed = y->begin, .offset = y->begin, .at = (unsigned)y->begin };
  y->root = NULL;
  fy_diag_cfg_default (&quiet);
  quiet.fp = NULL;
  errno = 0;
  x.diag = pw_check_memory (TREE_RESERVE) == PW_OK ? fy_diag_create (&quiet) : NULL;
  if (x.diag) {
    fy_diag_set_collect_errors (x.diag, true); /* prints nothing */
    struct fy_parse_cfg how = { .flags = FYPCF_ALLOW_DUPLICATE_KEYS, .diag = x.diag };
    x.parser = fy_parser_create (&how);
    x.pieces = fy_token_iter_create (NULL);
  }
  if (!x.parser || !x.pieces || fy_parser_set_input_callback (x.parser, &x, tree_feed) != 0)
    pw_yaml_no_memory (y, &cause);
  while (cause.status == PW_OK && (e = fy_parser_parse (x.parser)) != NULL) {
    if (cause.status == PW_OK) tree_event (&x, e); /* unless tree_feed has failed */
    fy_parser_event_free (x.parser, e);
  }
  if (cause.status == PW_OK && fy_parser_get_stream_error (x.parser)) tree_syntax (&x);
  if (errno == ENOMEM) cause.status = PW_OK, pw_yaml_no_memory (y, &cause);
  fy_token_iter_destroy (x.pieces);
  if (x.parser) fy_parser_destroy (x.parser);
  if (x.diag) fy_diag_destroy (x.diag);
  return cause.status == PW_OK ? PW_OK : pw_fail (error, cause.status, "%s", cause.text);
}
