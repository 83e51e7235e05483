
# ---- Methods: a colour and a mark for each integrator, a dash for each stabilisation ----
# Against time, a mark for each method, at points of its own.  Labels that are not methods have no stabilisation: each
# line differs from the others.

spread = name eq 'drift'

array number[methods]
numbers = 0
without(s) = (plus = strstrt(s, '+'), colon = strstrt(s, ':'), \
  plus == 0 ? s : s[1:plus - 1].(colon > plus ? s[colon:*] : ''))
do for [i = 1:methods] {
  number[i] = numbers
  do for [j = 1:i - 1] { if (without(label[j]) eq without(label[i])) { number[i] = number[j] } }
  if (number[i] == numbers) { numbers = numbers + 1 }
}
known = 'projection none baumgarte ggl nullspace index2 si1 index3'
dashes = '1 (2,4) (14,6) (14,5,3,5) (30,8) (14,5,3,5,3,5) (24,5,24,5,3,5) (6,6) (20,4,2,4,2,4,2,4)'
dash(s) = (place = 9, sum [k = 1:8] (word(known, k) eq s ? (place = k) : 0), word(dashes, place))
colours = '#004488 #bb5566 #997700 #000000 #228877 #774499 #777777'
marks = '7 4 9 12 5 6 2 8 13 1 10 3 11'
longest = 0
do for [i = 1:methods] {
  eval sprintf("set style line %d lw 1.6 ps %g pi %d dt %s lc rgb '%s' pt %s", i, spread ? 0.8 : 0.9, \
               spread ? 17 + 3*((i - 1) % 5) : 1, \
               stabilisation[i] eq '' ? word('1 (14,6) (14,5,3,5) (4,4)', (i - 1) % 4 + 1) : dash(stabilisation[i]), \
               word(colours, number[i] % 7 + 1), word(marks, (spread ? i - 1 : number[i]) % 13 + 1))
  longest = max(longest, strlen(label[i]))
}
