# Completion of pinwheel's commands, options, models and methods, for bash, and for zsh through bashcompinit.

_pinwheel () {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} words='' files=''
  case "$COMP_CWORD $before $word" in
  '1 '*) words=$(pinwheel --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p') ;;
  *' --method '* | *' -m '* | *' --methods '*)
    words=$(pinwheel list | sed -n '/^methods/,/^kinds/{/^kinds/d; s/^methods//; p;}' |
      awk '{ print $1; for (i = 2; i <= NF; i++) print $1 $i }') ;;
  *' '*' -'*) words=$(pinwheel "${COMP_WORDS[1]}" --help | grep -oE -- '--[a-z-]+') ;;
  '2 list '*) words='models methods kinds signals' ;;
  '2 '*) files=1 words=$(pinwheel list | sed -n '/^models/,/^methods/{/^methods/d; s/^models//; p;}') ;;
  *) files=1 ;;
  esac
  COMPREPLY=($(compgen -W "$words" -- "$word") $([ -z "$files" ] || compgen -f -- "$word"))
}
complete -o filenames -F _pinwheel pinwheel
