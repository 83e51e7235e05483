
# ---- A family of curves: a block of the data and a label each; more than 12 are coloured by number ----

numbered = curves > 12
longest = 0
if (!numbered) { do for [i = 1:curves] { longest = max(longest, strlen(short(label[i]))) } }
columns = max(1, int((width - left - right)/(80 + 9.0*longest)))
if (numbered) { right = 100 } else { top = top + 22*((curves + columns - 1)/columns) }
legend(bar) = !numbered ? key(34.0, columns).' samplen 3.5' : \
  sprintf("unset key; set cbrange [1:%d]; set cblabel 'number of the %s'; ", numbers, what). \
  (bar ? 'set colorbox user origin screen 0.9,graph 0 size screen 0.02,graph 1' : 'unset colorbox')
draw(x, y, titled) = numbered ? \
  sprintf('plot data using %d:%d:%d with lines lw 1.2 dt 1 lc palette', x, y, last) : \
  sprintf('plot for [i = 1:curves] data index i - 1 using %d:%d with lines lt i ', x, y). \
  (titled ? 'title short(label[i])' : 'notitle')

# gnuplot chooses the range unless the values are nearly constant.
size(lo, hi) = max(abs(lo), abs(hi))
yrange(lo, hi) = hi - lo > 1e-6*size(lo, hi) ? 'set yrange [*:*]' : \
  sprintf('set yrange [%.9g:%.9g]', lo - (size(lo, hi) > 0 ? 0.1*size(lo, hi) : 1), hi + (size(lo, hi) > 0 ? 0.1*size(lo, hi) : 1))
