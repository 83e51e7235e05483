#!/bin/sh
# Writes the manual page of a command, from its --help:  man.sh PROGRAM COMMAND
summary=$("$1" --help | sed -n "s/^  $2  *//p")
"$1" "$2" --help | awk -v name="$2" -v summary="$summary" '
  function text(s) { gsub (/\\/, "\\e", s); gsub (/-/, "\\-", s); gsub (/[.] /, ".\n", s); return s ~ /^[.\047]/ ? "\\&" s : s }
  function close_list() { if (list) print ".El"; list = 0 }
  BEGIN { print ".Dd November 23, 2026\n.Dt PINWHEEL-" toupper (name) " 1\n.Os\n.Sh NAME\n.Nm pinwheel-" name "\n.Nd " text(summary) }
  /^Usage: / { print ".Sh SYNOPSIS\n" text(substr ($0, 8)) "\n.Sh DESCRIPTION"; next }
  /^[A-Z].*:$/ { close_list(); if (!options++) print ".Sh OPTIONS"; print ".Ss " text(substr ($0, 1, length ($0) - 1)); next }
  options && /^ +-/ {
    if (!list++) print ".Bl -tag -width Ds"
    sub (/^ +/, "")
    at = match ($0, /  +/)
    print ".It " text(at ? substr ($0, 1, at - 1) : $0)
    if (at) print text(substr ($0, at + RLENGTH))
    next
  }
  $0 == "" { paragraph = written; next }
  { sub (/^ +/, ""); if (paragraph && !options) print ".Pp"; print text($0); written = 1; paragraph = 0 }
  END { close_list(); print ".Sh SEE ALSO\n.Xr pinwheel 1" }'
