# include look.gp

# ---- Steady motions: eigenvalues over the parameter, stable parts solid, unstable ones dashed; root locus ----
# Above: label_of_x, first and last (range of the parameter), folds and changes (numbers of events), re_min to re_max and im_min to im_max (of eigenvalues).
# Blocks of the data: stable and unstable parts (parameter, real part [1/s], frequency [Hz]), events (parameter; 1:
# fold, larger: change of stability), eigenvalues (parameter, real and imaginary part [1/s]).

data = name.'.dat'
title = 'eigenvalues of steady motions'
legend_top = top
top = top + rows(4, 2)
panel_height = narrow ? 92.0 : 118.0
height = top + 3*panel_height + 10 + bottom + 6 + bottom
# Modes that decay much faster than others grow or oscillate are not shown, unless the others are nearly 0.
slow = 5*max(re_max, im_max)
if (slow > -5e-3*re_min) { re_min = max(re_min, -slow) }
unset offsets
margin = max(0.04*max(re_max - re_min, 1e-3), 0.05*max(abs(re_min), abs(re_max))*(re_max - re_min < 1e-3*abs(re_min)))
left = margin_of(re_min - margin, re_max + margin, 0)
bar_low = re_min - margin # vertical lines across the panel
bar_length = re_max - re_min + 2*margin
do for [form in forms] {
  eval page(form)
  eval key(legend_top, 2)
  set xrange [first:last]
  eval bare_x
  set ylabel 'real part [1/s]'
  set yrange [re_min - margin:re_max + margin]
  eval panel(left, width - right, top, top + panel_height)
  plot data index 0 using 1:2 with lines lw 1.1 dt 1 lc rgb '#004488' title 'stable', \
       data index 1 using 1:2 with lines lw 1.1 dt (8,5) lc rgb '#cc6677' title 'unstable', \
       data index 2 using 1:($2 > 1 ? bar_low : NaN):(0):(bar_length) \
         with vectors nohead dt (2,4) lw 0.7 lc rgb '#000000' title (changes ? 'stability changes' : ''), \
       data index 2 using 1:($2 == 1 ? bar_low : NaN):(0):(bar_length) \
         with vectors nohead dt (10,4,2,4) lw 0.7 lc rgb '#c49a00' title (folds ? 'fold' : '')
  set format x
  set xlabel label_of_x noenhanced
  set ylabel 'frequency [Hz]'
  most_imaginary = max(im_max, -im_min) > 1e-9*max(1, max(re_max, -re_min)) ? max(im_max, -im_min) : 2*pi
  set yrange [0:1.08*most_imaginary/(2*pi)]
  eval panel(left, width - right, top + panel_height + 10, top + 2*panel_height + 10)
  plot data index 0 using 1:($3 > 1e-12 ? $3 : NaN) with lines lw 1.1 dt 1 lc rgb '#004488' title '', \
       data index 1 using 1:($3 > 1e-12 ? $3 : NaN) with lines lw 1.1 dt (8,5) lc rgb '#cc6677' title ''
  set xlabel 'real part [1/s]' enhanced
  set ylabel 'imaginary part [1/s]'
  set xrange [re_min - margin:re_max + margin]
  set yrange [-1.08*most_imaginary:1.08*most_imaginary]
  set arrow 1 from 0,graph 0 to 0,graph 1 nohead lw 0.5 lc rgb '#999999'
  set cblabel label_of_x offset 1.5,0 noenhanced
  set cbrange [first:last]
  eval panel(left, width - right - 62, height - bottom - panel_height, height - bottom)
  plot data index 3 using 2:3:1 with points pt 7 ps 0.35 lc palette title ''
  unset arrow 1
  eval finish
}
