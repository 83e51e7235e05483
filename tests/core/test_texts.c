/* External texts that are not valid UTF-8 or contain control characters: they reach neither the terminal nor a
 * summary. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cli.h"
#include "pinwheel-files.h"
#include "util.h"

/* Characters of one to four bytes, and sequences that are overlong, too high, surrogates or truncated. */
TEST (characters) {
  static const struct {
    const char *text;
    int size;
  } each[] = {
    { "a", 1 },
    { "\x7f", 1 },
    { "\x80", 0 },
    { "\xC2\x80", 2 },
    { "\xC1\xBF", 0 }, /* overlong */
    { "\xC3", 0 },
    { "\xE2\x82\xAC", 3 },
    { "\xE0\x9F\xBF", 0 },
    { "\xED\xA0\x80", 0 }, /* a surrogate */
    { "\xE2\x82", 0 },
    { "\xF0\x9F\x9B\xB4", 4 },
    { "\xF0\x8F\xBF\xBF", 0 },
    { "\xF4\x90\x80\x80", 0 }, /* beyond U+10FFFF */
    { "\xFF", 0 },
  };
  for (size_t i = 0; i < sizeof each / sizeof *each; i++) assert_int_equal (pw_utf8_size (each[i].text), each[i].size);
}

TEST (controls) {
  char text[] = "a\033[31m\n\tb\377\177\302\233\303\266";
  assert_int_equal (pw_is_text ("a line\n\tand another: \303\266"), 1);
  assert_int_equal (pw_is_text (text), 0);
  pw_text_sanitise (text);
  assert_string_equal (text, "a?[31m\n\tb????\303\266");
  assert_int_equal (pw_is_text (text), 1);
}

/* Messages quote external texts. */
TEST (message) {
  pw_error error = { 0 };
  pw_fail (&error, PW_INPUT, "there is no \"%s\"", "\033]0;title\007\xff");
  check_error (&error, PW_INPUT, "there is no \"?]0;title??\"");
}

/* JSON: control characters are escaped, invalid bytes replaced. */
TEST (summary) {
  pw_error error = { 0 };
  pw_summary summary = { .model = "a\033\xff\"\\\n", .method = "1", .status = "ok", .reason = "\xC3" };
  pw_output *o = pw_output_open (cli_path ("a.json"), &error);
  check_ok (pw_json_write (&summary, NULL, NULL, 0, NULL, o, &error), &error);
  check_ok (pw_output_finish (o, &error), &error);
  const char *text = cli_file ("a.json");
  assert_non_null (strstr (text, "\"model\": \"a\\u001B\xEF\xBF\xBD\\\"\\\\\\n\""));
  assert_non_null (strstr (text, "\"method\": \"1\""));
  assert_non_null (strstr (text, "\"reason\": \"\xEF\xBF\xBD\""));
}

/* A model in C with this `about`, unit of its parameter and name of its body is rejected with the message. */
static void texts_model (const char *about, const char *unit, const char *body, const char *message) {
  cli_write (
      "own.c",
      check_text ("#include <pinwheel.h>\n"
                  "typedef struct { double a; } P;\n"
                  "static const pw_parameter p[] = { { PW_AT (P, a), .unit = \"%s\" }, { .name = NULL } };\n"
                  "static void build (pw_model *m, const void *p) {\n"
                  "  (void)p;\n"
                  "  pw_add_body (m, &(pw_body){ .name = \"%s\", .mass = 1, .inertia = 1 });\n"
                  "}\n"
                  "PW_MODEL (.about = \"%s\", .parameters = p, .parameters_size = sizeof (P), .build = build);\n",
                  unit, body, about));
  cli_bad ("pinwheel show @/own.c", 2, message);
}

TEST (model) {
  texts_model ("\\033[31m", "m", "a", "@/own.c: .about is not text: expected UTF-8 without control characters");
  texts_model ("good", "\\377", "a",
               "@/own.c: name, unit or meaning of parameter a is not text: expected UTF-8 without control characters");
  texts_model ("good", "m\\nm", "a",
               "@/own.c: name, unit or meaning of parameter a is not text: expected UTF-8 without control characters");
  texts_model ("good", "m", "a\\033[31m",
               "model own: body \"a?[31m\": expected letters, digits, _, - and characters beyond ASCII");
}

TEST (file_name) {
  cli_good ("cp tests/models/arm.yaml \"$(printf '@/a\\033[31m.yaml')\"");
  cli_bad ("pinwheel show \"$(printf '@/a\\033[31m.yaml')\"", 2,
           "@/a?[31m.yaml: the name of a model file is UTF-8 without control characters");
  cli_good ("cp tests/models/arm.yaml \"$(printf '@/a\\nb.yaml')\"");
  cli_bad ("pinwheel show \"$(printf '@/a\\nb.yaml')\"", 2,
           "@/a\nb.yaml: the name of a model file is UTF-8 without control characters");
  cli_good ("PINWHEEL_MODELS=@ pinwheel list models | grep -c '^b' || true");
  assert_string_equal (cli_out, "0\n");
  cli_good ("PINWHEEL_MODELS=@ pinwheel list models | tr -d '\\n' | LC_ALL=C tr -d ' -~' | wc -c");
  assert_string_equal (cli_out, "0\n");
}

const check_fixture fixture = { cli_setup, cli_teardown };
