# include look.gp

# ---- Steady motions: eigenvalues over the parameter, stable parts solid, unstable ones dashed; root locus ----

data = name.'.dat'
title = 'eigenvalues of steady motions'
above = top
top = top + rows(4, 2)
part = narrow ? 92.0 : 118.0
height = top + 3*part + 10 + bottom + 6 + bottom
# modes that decay much faster than the others swing or grow are outside
slow = 5*max(y_max, z_max)
if (slow > -5e-3*y_min) { y_min = max(y_min, -slow) }
unset offsets
margin(a, b) = 0.04*max(b - a, 1e-3)
do for [form in forms] {
  eval page(form)
  eval key(above, 2)
  set xrange [first:last]
  set format x ''
  set xlabel ''
  set ylabel 'real part [1/s]'
  set yrange [y_min - margin(y_min, y_max):y_max + margin(y_min, y_max)]
  eval panel(left, width - right, top, top + part)
  plot data index 0 using 1:2 with lines lw 1.1 dt 1 lc rgb '#004488' title 'stable', \
       data index 1 using 1:2 with lines lw 1.1 dt (8,5) lc rgb '#cc6677' title 'unstable', \
       data index 2 using 1:($2 > 1 ? y_min - margin(y_min, y_max) : NaN):(0):(y_max - y_min + 2*margin(y_min, y_max)) \
         with vectors nohead dt (2,4) lw 0.7 lc rgb '#000000' title 'stability changes', \
       data index 2 using 1:($2 == 1 ? y_min - margin(y_min, y_max) : NaN):(0):(y_max - y_min + 2*margin(y_min, y_max)) \
         with vectors nohead dt (10,4,2,4) lw 0.7 lc rgb '#c49a00' title 'fold'
  set format x
  set xlabel label_of_x noenhanced
  set ylabel 'frequency [Hz]'
  top_of_z = max(z_max, -z_min) > 1e-9*max(1, max(y_max, -y_min)) ? max(z_max, -z_min) : 2*pi
  set yrange [0:1.08*top_of_z/(2*pi)]
  eval panel(left, width - right, top + part + 10, top + 2*part + 10)
  plot data index 0 using 1:($3 > 1e-12 ? $3 : NaN) with lines lw 1.1 dt 1 lc rgb '#004488' title '', \
       data index 1 using 1:($3 > 1e-12 ? $3 : NaN) with lines lw 1.1 dt (8,5) lc rgb '#cc6677' title ''
  set xlabel 'real part [1/s]' enhanced
  set ylabel 'imaginary part [1/s]'
  set xrange [y_min - margin(y_min, y_max):y_max + margin(y_min, y_max)]
  set yrange [-1.08*top_of_z:1.08*top_of_z]
  set arrow 1 from 0,graph 0 to 0,graph 1 nohead lw 0.5 lc rgb '#999999'
  set cblabel label_of_x offset 1.5,0 noenhanced
  set cbrange [first:last]
  eval panel(left, width - right - 62, height - bottom - part, height - bottom)
  plot data index 3 using 2:3:1 with points pt 7 ps 0.35 lc palette title ''
  unset arrow 1
  unset multiplot
  unset output
}
