/* Lines of journals and parts, and files in memory. */
#define _POSIX_C_SOURCE 200809L
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include "sweep.h"

/* ---- Lines ---- */

/* FNV-1a (Fowler, Noll, Vo) of a row's number, status and text. */
static uint32_t line_sum (long row, int status, const char *text, size_t size) {
  uint32_t h = 2166136261u;
  for (int i = 0; i < 32; i += 8) h = (h ^ (((uint32_t)row >> i) & 255)) * 16777619u;
  h = (h ^ (uint32_t)status) * 16777619u;
  for (size_t i = 0; i < size; i++) h = (h ^ (unsigned char)text[i]) * 16777619u;
  return h;
}

void pw_line_add (pw_text *t, long row, int status, const char *text) {
  char front[60];
  size_t n = strlen (text);
  snprintf (front, sizeof front, "%ld %d %08lx ", row, status, (unsigned long)line_sum (row, status, text, n));
  pw_text_add (t, front);
  pw_text_add_bytes (t, text, n);
  pw_text_add (t, "\n");
}

/* Reads digits of a base up to 16, then a space; -1 if they are not there. */
static long line_digits (const char **at, const char *end, int base) {
  static const char digits[] = "0123456789abcdef";
  const char *c = *at;
  long value = 0;
  for (; c < end && *c && c - *at < 12; c++) {
    const char *digit = strchr (digits, *c);
    if (digit == NULL || digit - digits >= base) break;
    value = value * base + (digit - digits);
  }
  if (c == *at || c == end || *c != ' ') return -1;
  *at = c + 1;
  return value;
}

int pw_line_read (const char *at, const char *end, pw_line *line) {
  const char *newline = at < end ? memchr (at, '\n', (size_t)(end - at)) : NULL, *c = at;
  if (newline == NULL) return 0;
  line->row = line_digits (&c, newline, 10);
  long status = line->row < 0 ? -1 : line_digits (&c, newline, 10);
  long sum = status < 0 ? -1 : line_digits (&c, newline, 16);
  if (sum < 0 || status > 4) return 0;
  line->status = (int)status;
  line->text = c;
  line->size = (size_t)(newline + 1 - c);
  line->bytes = (size_t)(newline + 1 - at);
  return line_sum (line->row, line->status, c, line->size - 1) == (uint32_t)sum;
}

/* ---- Files in memory ---- */

int pw_map_open (pw_map *m, int file) {
  struct stat info;
  *m = (pw_map){ "", "" };
  m->end = m->at;
  if (fstat (file, &info) != 0) return PW_MACHINE;
  if (info.st_size == 0) return PW_OK;
  void *at = mmap (NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, file, 0);
  if (at == MAP_FAILED) return PW_MACHINE;
  m->at = at;
  m->end = m->at + info.st_size;
  return PW_OK;
}

void pw_map_close (pw_map *m) {
  if (m->end > m->at) munmap ((void *)(size_t)m->at, (size_t)(m->end - m->at));
  *m = (pw_map){ NULL, NULL };
}
