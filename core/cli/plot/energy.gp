
# ---- Energies, work, and the error of the energy balance in a unit of its own ----

title = 'energy, work and their balance'
stats 'energy.dat' using 2 name 'kinetic' nooutput
stats 'energy.dat' using 3 name 'potential' nooutput
stats 'energy.dat' using 4 name 'work' nooutput
stats 'energy.dat' using 5 name 'loss' nooutput
stats 'energy.dat' using 7 name 'balance' nooutput
at_rest = kinetic_min == 0 && kinetic_max == 0 && potential_min == potential_max && work_min == work_max
largest = max(abs(balance_min), abs(balance_max))
exponent = largest > 0 ? floor(log10(largest)) : 0
if (abs(exponent) <= 2) { exponent = 0 }
raised(s) = strlen(s) == 0 ? '' : (s[1:1] eq '-' ? '⁻' : word('⁰ ¹ ² ³ ⁴ ⁵ ⁶ ⁷ ⁸ ⁹', s[1:1] + 1)).raised(s[2:*])
curves = "plot 'energy.dat' using 1:2 with lines lw 5 dt 1 lc rgb '#ddaa33' title 'kinetic'"
if (potential_min != 0 || potential_max != 0) {
  curves = curves.", '' using 1:3 with lines lw 1.8 dt (14,4) lc rgb '#888888' title 'potential'"
}
if (loss_min != 0 || loss_max != 0) {
  curves = curves.", '' using 1:5 with lines lw 1.8 dt (4,3) lc rgb '#bb5566' title 'dissipated'"
}
curves = curves.", '' using 1:4 with lines lw 1.5 dt 1 lc rgb '#004488' title 'work'"
top = top + 22
height = top + 2*235 + 16 + bottom
set xrange [0:t_end]
do for [form in 'svg png'] {
  eval page(form)
  eval key(34.0, 8).' samplen 3.5'
  set format x ''
  unset xlabel
  set ylabel 'energy, work [J]'
  if (at_rest) { set yrange [-1:1] } else { set yrange [*:*] }
  eval panel(left, width - right, top, top + 235.0)
  eval curves
  set format x
  set xlabel 't [s]'
  set ylabel 'balance ['.(exponent ? '10'.raised(sprintf('%d', exponent)).' ' : '').'J]'
  if (balance_min == balance_max) { set yrange [-1:1] } else { set yrange [*:*] }
  eval panel(left, width - right, top + 251.0, top + 486.0)
  plot 'energy.dat' using 1:($7/10.0**exponent) with lines lt 1 lw 1 notitle
  unset multiplot
  unset output
}
