#!/bin/sh
# Writes a page with its tables of options made anew from --help:  options.sh PROGRAM PAGE
#
# A table stands between the lines "<!-- options of COMMAND: make options -->" and "<!-- end -->".  Options of
# the model are left out, and those that `run` has with the same meaning are only named.
awk -v program="$1" '
  # Reads the options of a command into name[1], text[1], ...; returns their number.
  function read(command, name, text,    line, at, n, on) {
    command = program " " command " --help"
    while ((command | getline line) > 0) {
      if (line ~ /^[A-Z][a-z]*:$/) on = line !~ /^(Model|Other):/
      else if (on && line ~ /^  (-.,|   ) --/) {
        sub (/^ +/, "", line)
        at = match (line, /  +/)
        name[++n] = at ? substr (line, 1, at - 1) : line
        text[n] = at ? substr (line, at + RLENGTH) : ""
      } else if (on && sub (/^ +/, "", line)) text[n] = text[n] (text[n] == "" ? "" : " ") line
    }
    close (command)
    return n
  }
  function code(name) {
    if (match (name, /--[a-z-]+=/)) name = substr (name, 1, RSTART + RLENGTH - 2) " " substr (name, RSTART + RLENGTH)
    gsub (/\|/, "\\|", name)
    sub (/, /, "`, `", name)
    return "`" name "`"
  }
  function table(command,    name, text, n, i, same) {
    print "\n|option of `" command "`|meaning|\n|---|---|"
    n = read(command, name, text)
    for (i = 1; i <= n; i++)
      if (command != "run" && known[name[i]] == text[i]) same = same " `" substr (name[i], match (name[i], /--[a-z-]*/), RLENGTH) "`"
      else print "|" code(name[i]) "|" text[i] "|"
    if (same != "") print "|" substr (same, 2) "|as of `run`|"
    print ""
  }
  BEGIN { for (n = read("run", name, text); n > 0; n--) known[name[n]] = text[n] }
  /^<!-- end -->$/ { inside = 0 }
  !inside { print }
  /^<!-- options of / { inside = 1; command = $4; sub (/:$/, "", command); table(command) }' "$2"
