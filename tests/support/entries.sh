#!/bin/sh
# Sets of test inputs: one text file for many small files, its entries.
#
#   entries.sh unpack SET FOLDER     writes every entry to the folder, which is made, under its name
#   entries.sh add SET FILE...       appends files as entries
#
# An entry begins with a line "==== NAME", and the lines after it are its contents.  After "==== NAME escaped" \\ is a
# backslash, \ooo the byte of this octal number, and a single \ at the end of a line leaves out the line end: for bytes
# that are not text, long lines, a last line without an end, lines like that of a name.  Text before the first entry is
# a comment.

unpack () {
  mkdir -p "$2" || return 1
  # A script for printf, which can write every byte.
  LC_ALL=C awk -v set="$1" '
    function close_entry() { if (name != "") print q " >" name " || exit 1" }
    function wrong(what) { print set ":" NR ": " what >"/dev/stderr"; bad = 1; exit 1 }
    BEGIN { q = sprintf("%c", 39) }
    /^==== / {
      close_entry()
      name = $2; escaped = $3 == "escaped"
      if (NF != 2 + escaped || name !~ /^[A-Za-z0-9_][A-Za-z0-9._-]*$/) wrong("expected ==== NAME, or ==== NAME escaped")
      if (seen[name]++) wrong("a second entry " name)
      printf "%s", escaped ? "printf -- " q : "printf %s " q
      next
    }
    name != "" {
      joined = escaped && match($0, /\\+$/) && RLENGTH % 2
      if (joined) $0 = substr($0, 1, length($0) - 1)
      if (escaped) gsub(/%/, "%%")
      gsub(q, q "\"" q "\"" q)
      printf "%s%s", $0, joined ? "" : "\n"
    }
    END { if (bad) exit 1; close_entry() }' "$1" >"$2/.script" && (cd "$2" && sh .script) && rm "$2/.script"
}

add () {
  set=$1
  shift
  for f; do
    if [ "$(LC_ALL=C tr -d '\n -~' <"$f" | wc -c)" -eq 0 ] && [ -z "$(tail -c 1 "$f")" ] && ! grep -q '^==== ' "$f"; then
      echo "==== $(basename "$f")"
      cat "$f"
    else
      echo "==== $(basename "$f") escaped"
      od -An -v -to1 "$f" | LC_ALL=C awk '
        function put(text) {
          if (length(line) + length(text) > 118) { print line "\\"; line = "" }
          line = line text
        }
        { for (i = 1; i <= NF; i++) {
            code = substr($i, 1, 1) * 64 + substr($i, 2, 1) * 8 + substr($i, 3)
            if (code == 10) { print line; line = ""; ended = 1; continue }
            ended = 0
            if (code == 92) put("\\\\")
            else put(code < 32 || code > 126 || (code == 61 && line == "") ? "\\" $i : sprintf("%c", code))
          } }
        END { if (NR && !ended) print line "\\" }'
    fi
  done >>"$set"
}

case $#-$1 in
3-unpack) unpack "$2" "$3" ;;
[3-9]*-add | [1-9][0-9]*-add) shift && add "$@" ;;
*) sed -n '4,5s/^# *//p' "$0" >&2; exit 2 ;;
esac
