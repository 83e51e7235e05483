
# ---- Methods: a colour for each integrator, a dash for each stabilisation, a mark for each method ----
# Above: methods (number of curves), label[i], stabilisation[i]: '' if the label is not a method but, for example, the
# value of an option; then dashes only tell neighbours apart.

array number[methods] # of the integrator with its options, from 0
numbers = 0
# A label without its stabilisation.
without(s) = (plus = strstrt(s, '+'), colon = strstrt(s, ':'), \
  plus == 0 ? s : s[1:plus - 1].(colon > plus ? s[colon:*] : ''))
do for [i = 1:methods] {
  number[i] = numbers
  do for [j = 1:i - 1] { if (without(label[j]) eq without(label[i])) { number[i] = number[j] } }
  if (number[i] == numbers) { numbers = numbers + 1 }
}
known = 'projection none baumgarte ggl nullspace index2 si1 index3'
dashing = '1 (2,3) (10,4) (10,4,3,4) (20,6) (10,3,3,3,3,3) (16,4,16,4,3,4) (5,5) (14,3,2,3,2,3,2,3)'
dash(s) = (place = 9, sum [k = 1:8] (word(known, k) eq s ? (place = k) : 0), word(dashing, place))
# Point types, filled and open in turn, so that neighbours differ most.
marks = '7 4 9 12 5 6 13 8 11 10 15 14 2 1 3'
label_length = 0
do for [i = 1:methods] {
  eval sprintf("set style line %d lw %.2f dt %s lc rgb '%s' pt %s", i, 0.7*thickness(i, methods), \
               stabilisation[i] eq '' ? word('1 (10,4) (10,4,3,4) (4,4)', (i - 1) % 4 + 1) : dash(stabilisation[i]), \
               colour(number[i] + 1), word(marks, (i - 1) % 15 + 1))
  label_length = max(label_length, strlen(label[i]))
}
per_row = columns(label_length)
legend_top = top
top = top + rows(methods, per_row)
