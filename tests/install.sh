#!/bin/sh
# What `make install` puts below a folder works from there: the program, a model in C and one as text by their paths, a
# program that embeds the libraries through pkg-config; uninstall leaves nothing.  Reads BUILD, CC.

build=${BUILD:-build} cc=${CC:-cc}
. "$(dirname "$0")/report.sh"

destination=$work/root prefix=/opt/pinwheel
top=$destination$prefix
install="make -s --no-print-directory NO_DEPS=1 BUILD=$build DESTDIR=$destination PREFIX=$prefix"

$install install >"$work/log" 2>&1
report 'install' $?

# What is there is found without the build: from another folder, with the search path empty.
cd "$work" && unset PINWHEEL_MODELS
"$top/bin/pinwheel" run ezyroller --t-end 1 >"$work/log" 2>&1
report 'the program runs an installed model' $?
"$top/bin/pinwheel" list models >"$work/log" 2>&1 && grep -q '^ *chaplygin-sleigh' "$work/log"
report 'and lists them' $?

abi=$("$top/bin/pinwheel" --version | sed -n 's/.*ABI \([0-9]*\).*/\1/p')
for l in libpinwheel libpinwheel-files; do
  objdump -p "$top/lib/$l.so" 2>"$work/log" | grep -q "SONAME *$l.so.$abi\$" && [ -e "$top/lib/$l.so.$abi" ]
  report "$l.so carries the ABI in its soname" $?
done

"$top/bin/pinwheel" new mine.c >"$work/log" 2>&1 &&
  $cc -std=c11 -fPIC -shared -I"$top/include/pinwheel" mine.c -o mine.so -lm >"$work/log" 2>&1 &&
  "$top/bin/pinwheel" run ./mine.so --t-end 0.1 >"$work/log" 2>&1
report 'a plug-in compiled against the installed headers' $?
"$top/bin/pinwheel" run ./mine.c --t-end 0.1 >"$work/log" 2>&1
report 'a model in C, compiled on the fly' $?
"$top/bin/pinwheel" new text.yaml >"$work/log" 2>&1 && "$top/bin/pinwheel" run ./text.yaml --t-end 0.1 >"$work/log" 2>&1
report 'a model as text' $?

cd - >/dev/null || exit 1
if command -v pkg-config >/dev/null; then
  export PKG_CONFIG_PATH="$top/lib/pkgconfig"
  flags=$(pkg-config --define-variable=prefix="$top" --cflags --libs pinwheel 2>"$work/log")
  report 'pkg-config knows it' $?
  $cc -std=c11 docs/embed.c -o "$work/embed" $flags -Wl,-rpath,"$top/lib" -lm >"$work/log" 2>&1 &&
    (cd "$work" && ./embed) >"$work/log" 2>&1
  report 'a program that embeds it' $?
  [ "$(pkg-config --modversion pinwheel)" = "$("$top/bin/pinwheel" --version | cut -d' ' -f2)" ] &&
    grep -q "^version: $(pkg-config --modversion pinwheel)\$" docs/CITATION.cff
  report 'one version everywhere' $?
else
  $cc -std=c11 -I"$top/include/pinwheel" docs/embed.c -o "$work/embed" -L"$top/lib" -lpinwheel-files -lpinwheel \
    -Wl,-rpath,"$top/lib" -lm >"$work/log" 2>&1 && (cd "$work" && ./embed) >"$work/log" 2>&1
  report 'a program that embeds it' $?
fi

if command -v c++ >/dev/null; then
  cat >"$work/plus.cc" <<'EOF'
#include "pinwheel-files.h"
#include "pinwheel-solvers.h"
int main () {
  pw_error e = {};
  pw_settings settings = {};
  pw_file *file = pw_file_open ("pendulum", &e);
  pw_model *model = pw_file_model (file, &e);
  pw_build (model, &e);
  pw_system *system = pw_compile (model, &e);
  pw_run *run = pw_open (system, "ida+ggl", &settings, &e);
  pw_advance_to (run, 1, 1, &e);
  pw_close (run), pw_free (system), pw_model_free (model), pw_file_close (file);
  return -e.status;
}
EOF
  c++ -std=c++11 -Wall -Wextra -Wpedantic -Werror -I"$top/include/pinwheel" "$work/plus.cc" -o "$work/plus" -L"$top/lib" \
    -lpinwheel-files -lpinwheel -Wl,-rpath,"$top/lib" >"$work/log" 2>&1 && (cd "$work" && ./plus) >"$work/log" 2>&1
  report 'and one in C++' $?
fi

# Every option of run, every command and every key of a model stands in its page.
missing=
for word in $("$top/bin/pinwheel" run --help | sed -n 's/^ .*--\([a-z-]*\).*/\1/p'); do
  [ "$word" = help ] || sed 's/ , / /g; s/\\-/-/g' "$top/share/man/man1/pinwheel.1" | grep -q -- "-$word" || missing="$missing --$word"
done
for word in $("$top/bin/pinwheel" --help | sed -n 's/^  pinwheel \([a-z]*\) .*/\1/p'); do
  grep -q "^\.It Cm $word\$" "$top/share/man/man1/pinwheel.1" || missing="$missing $word"
done
echo "missing:$missing" >"$work/log"
[ -z "$missing" ]
report 'pinwheel(1) has every command, and every option of run' $?
sed -n '/^\.Bd -literal$/,/^\.Ed$/p' "$top/share/man/man5/pinwheel-model.5" | sed '1d;$d' >"$work/page.yaml"
"$top/bin/pinwheel" run "$work/page.yaml" --t-end 0.1 >"$work/log" 2>&1
report 'the example of pinwheel-model(5) runs' $?
if command -v mandoc >/dev/null; then
  mandoc -T lint -W warning "$top/share/man/man1/pinwheel.1" "$top/share/man/man5/pinwheel-model.5" >"$work/log" 2>&1
  report 'the pages are well formed' $?
fi

$install uninstall >"$work/log" 2>&1
find "$destination" ! -type d >"$work/log"
[ ! -s "$work/log" ]
report 'uninstall leaves nothing' $?

exit $bad
