#!/bin/sh
# What `make install` installs works without the build: the program, a model in C and one as text by their paths, a program
# that embeds the libraries through pkg-config; uninstall leaves nothing.  Reads BUILD, CC.

build=${BUILD:-build} cc=${CC:-cc}
. "$(dirname "$0")/../support/report.sh"

# The paths contain spaces; files of others are in "my", to which a wrong splitting of "my pinwheel" leads, and in lib.
destination="$work/a root" prefix='/opt/my pinwheel'
top=$destination$prefix
install () { make -s --no-print-directory NO_DEPS=1 BUILD="$build" DESTDIR="$destination" PREFIX="$prefix" "$1"; }
mkdir -p "$destination/opt/my" "$top/lib"
touch "$destination/opt/my/other" "$top/lib/other"

install install >"$work/log" 2>&1
report 'install' $?

# Installed models are found from another folder, without a search path in the environment.
cd "$work" && unset PINWHEEL_MODELS
"$top/bin/pinwheel" run ezyroller --t-end 1 >"$work/log" 2>&1
report 'the program runs an installed model' $?
for model in ezyroller car; do
  "$top/bin/pinwheel" page $model -o "$model.html" 2>"$work/log" && [ -s "$model.html" ] || grep -q 'built without the engine' "$work/log"
  report "its page: $model" $?
done
"$top/bin/pinwheel" list models >"$work/log" 2>&1 && grep -q '^ *chaplygin-sleigh' "$work/log"
report 'the program lists the installed models' $?

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
make -s --no-print-directory NO_DEPS=1 BUILD="$work/copied" "$work/copied/models/pendulum.yaml" >"$work/log" 2>&1 &&
  case $(readlink "$work/copied/models/pendulum.yaml") in /*) false ;; esac
report 'links to the models are relative, so that a build can be copied' $?

if command -v pkg-config >/dev/null; then
  export PKG_CONFIG_PATH="$top/lib/pkgconfig"
  cp "$top/share/doc/pinwheel/examples/embed.c" "$work"
  # The command in the file's comment, with the prefix of pkg-config changed to where the files are.
  sed -i "s|^prefix=.*|prefix=$top|" "$top/lib/pkgconfig/pinwheel.pc"
  (cd "$work" && eval "$cc -std=c11 embed.c -o embed $(pkg-config --cflags --libs pinwheel) -lm \
    -Wl,-rpath,\"$(pkg-config --variable=libdir pinwheel)\"" && ./embed) >"$work/log" 2>&1
  report 'a program that embeds the libraries, compiled as embed.c says' $?
  cp "$top/share/doc/pinwheel/examples/method.c" "$work"
  (cd "$work" && eval "$cc -std=c11 method.c -o method $(pkg-config --cflags --libs pinwheel) -lm \
    -Wl,-rpath,\"$(pkg-config --variable=libdir pinwheel)\"" && ./method) >"$work/log" 2>&1 &&
    awk '$NF == "nan" { next } { n++; bad += $NF < 2.9 || $NF > 3.1 } END { exit n != 6 || bad }' "$work/log"
  report 'a program with a method of its own, of order 3' $?
  awk '/^```yaml/ { n++; next } /^```/ { if (n == 1) exit } n == 1' "$top/share/doc/pinwheel/docs/analysis.md" >"$work/car-trailer.yaml"
  sed -n '/^    critical speed/,/^$/s/^    //p' "$top/share/doc/pinwheel/docs/analysis.md" >"$work/expected"
  cp "$top/share/doc/pinwheel/examples/analyse.c" "$work"
  (cd "$work" && eval "$cc -std=c11 analyse.c -o analyse $(pkg-config --cflags --libs pinwheel) -lm \
    -Wl,-rpath,\"$(pkg-config --variable=libdir pinwheel)\"" && ./analyse ./car-trailer.yaml >analysis) >"$work/log" 2>&1 &&
    [ -s "$work/expected" ] && diff "$work/expected" "$work/analysis" >"$work/log"
  report 'a program that analyses, with the results in analysis.md' $?
  # As pkg-config --static says: with shared libraries, with Pinwheel's archives, with archives alone.
  static_link () { # what, edit of the libraries
    (cd "$work" && rm -f analyse && eval "$cc -std=c11 analyse.c -o analyse $(pkg-config --cflags pinwheel) \
      $(pkg-config --static --libs pinwheel | sed "$2") -Wl,-rpath,\"$(pkg-config --variable=libdir pinwheel)\"" &&
      ./analyse ./car-trailer.yaml >analysis) >"$work/log" 2>&1 && diff "$work/expected" "$work/analysis" >"$work/log"
    report "a program linked by pkg-config --static with $1" $?
  }
  static_link 'shared libraries' ''
  static_link 'archives of Pinwheel' 's/-l\(pinwheel[a-z-]*\)/-l:lib\1.a/g'
  static_link 'archives alone' 's/^/-static /'
  [ "$(pkg-config --modversion pinwheel)" = "$("$top/bin/pinwheel" --version | sed -n '1s/^pinwheel \([^ ]*\).*/\1/p')" ] &&
    grep -q "^version: $(pkg-config --modversion pinwheel)\$" docs/CITATION.cff
  report 'one version everywhere' $?
else
  $cc -std=c11 -I"$top/include/pinwheel" docs/embed.c -o "$work/embed" -L"$top/lib" -lpinwheel-files -lpinwheel \
    -Wl,-rpath,"$top/lib" -lm >"$work/log" 2>&1 && (cd "$work" && ./embed) >"$work/log" 2>&1
  report 'a program that embeds the libraries' $?
fi

if command -v c++ >/dev/null; then
  cat >"$work/plus.cc" <<'EOF'
#include "pinwheel-files.h"
#include "pinwheel-analysis.h"
int main (int count, char **argument) {
  pw_error e = {};
  pw_settings settings = {};
  pw_file *file = pw_file_open (count > 1 ? argument[1] : "pendulum", &e);
  pw_model *model = pw_file_model (file, &e);
  pw_model_build (model, &e);
  pw_system *system = pw_system_compile (model, &e);
  pw_run *run = pw_run_open (system, "ida+ggl", &settings, &e);
  pw_run_advance_to (run, 1, 1, &e);
  pw_run_close (run), pw_system_free (system), pw_model_free (model), pw_file_close (file);
  return -e.status;
}
EOF
  c++ -std=c++11 -Wall -Wextra -Wpedantic -Werror -I"$top/include/pinwheel" "$work/plus.cc" -o "$work/plus" -L"$top/lib" \
    -lpinwheel-files -lpinwheel -Wl,-rpath,"$top/lib" >"$work/log" 2>&1 && (cd "$work" && ./plus && ./plus ./mine.c) >"$work/log" 2>&1
  report 'a program in C++ that embeds them, with a compiled model and with one in C' $?
fi

# A project that finds the package; in C++ it includes a header by its folder.
if command -v cmake >/dev/null && command -v c++ >/dev/null; then
  mkdir "$work/project" && sed 's|"pinwheel-files.h"|<pinwheel/pinwheel-files.h>|' "$work/plus.cc" >"$work/project/plus.cc"
  cp docs/embed.c "$work/project"
  cat >"$work/project/CMakeLists.txt" <<'EOF'
cmake_minimum_required (VERSION 3.10)
project (plus)
find_package (pinwheel 0.1 REQUIRED)
foreach (name plus.cc embed.c)
  add_executable (${name}.out ${name})
  target_link_libraries (${name}.out pinwheel::pinwheel)
endforeach ()
EOF
  (cd "$work/project" && cmake -DCMAKE_PREFIX_PATH="$top" . && cmake --build . && ./plus.cc.out && ./embed.c.out) >"$work/log" 2>&1
  report 'a project of CMake in C and C++ that finds the package' $?
  sed -i 's/pinwheel 0.1/pinwheel 0.2/' "$work/project/CMakeLists.txt"
  (cd "$work/project" && cmake -DCMAKE_PREFIX_PATH="$top" .) >"$work/log" 2>&1
  [ $? != 0 ] && grep -q 'version: 0.1.0' "$work/log"
  report 'one that asks for another version is refused' $?
fi

# The files to which the pages link exist.
for page in "$top/share/doc/pinwheel/"*.md "$top/share/doc/pinwheel/docs/"*.md; do
  grep -o '](\([^)#: ]*\)' "$page" | sed 's/^](//' | while read -r link; do
    [ -z "$link" ] || [ -e "$(dirname "$page")/$link" ] || echo "${page##*/}: $link"
  done
done >"$work/log"
[ ! -s "$work/log" ]
report 'links of the installed pages' $?

# Every command is in pinwheel(1), and has a page with each of its options.
missing= commands=0 man=$top/share/man/man1
for word in $("$top/bin/pinwheel" --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p'); do
  commands=$((commands + 1))
  grep -q "^\.It Cm $word\$" "$man/pinwheel.1" || missing="$missing $word"
  for option in $("$top/bin/pinwheel" "$word" --help | sed -n 's/^ .*--\([a-z-]*\).*/\1/p'); do
    sed 's/\\-/-/g' "$man/pinwheel-$word.1" | grep -q -- "^\.It .*--$option" || missing="$missing $word:--$option"
  done
done
echo "$commands commands; missing:$missing" >"$work/log"
[ -z "$missing" ] && [ $commands -gt 10 ]
report 'manual pages have every command and option' $?
sed -n '/^\.Bd -literal$/,/^\.Ed$/p' "$top/share/man/man5/pinwheel-model.5" | sed '1d;$d' >"$work/page.yaml"
"$top/bin/pinwheel" run "$work/page.yaml" --t-end 0.1 >"$work/log" 2>&1
report 'the example of pinwheel-model(5) runs' $?
if command -v mandoc >/dev/null; then
  mandoc -T lint -W warning "$man"/pinwheel*.1 "$top/share/man/man5/pinwheel-model.5" >"$work/log" 2>&1
  report 'the pages are well formed' $?
fi

"$top/bin/pinwheel" check "$top/share/doc/pinwheel/examples/elliptic-wire.c" >"$work/log" 2>&1
report 'an installed example with element types of its own' $?

install uninstall >"$work/log" 2>&1
find "$destination" ! -type d | LC_ALL=C sort >"$work/log"
[ "$(cat "$work/log")" = "$top/lib/other
$destination/opt/my/other" ] && [ ! -e "$top/share/doc/pinwheel" ] && [ ! -e "$top/include/pinwheel" ]
report 'uninstall leaves nothing and removes nothing else' $?

install uninstall >"$work/log" 2>&1 && rm -rf "$destination" && install uninstall >"$work/log" 2>&1
report 'uninstalling twice' $?

exit $bad
