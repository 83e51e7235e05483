# include look.gp
# include plane.gp

# ---- Snapshots of the motion: earlier ones fainter, the last one with symbols; paths of the markers ----
# Above: bodies (number of those with a name), body[i], by_time (1: colours show the time), markers (a list of blocks of
# wheels.dat, from 0), areas (a list of the colours of bodies with an area; 0: the ground), ground (1: ground.dat exists), t_end and
# t_closeup as for plane.gp.
# Blocks of the data file: 0 to 3 bodies, wheels, point masses, rods before the end; 4 to 7 the same at the end; 8 and 9
# open and closed strokes of symbols.  Columns: x, y, t, number of the body.

title = 'snapshots of the motion'.(by_time ? '' : ', earlier ones lighter')
array rgb[8]
do for [i = 1:8] { rgb[i] = int('0x'.colour(i)[2:7]) }
# A channel of a colour (65536 red, 256 green, 1 blue), mixed with white: strength 0 to 1.
mixed(value, channel, strength) = int(255 - strength*(255 - (value/channel) % 256))*channel
# The colour of a body; the ground and elements are grey.
shade(body, strength) = (c = body > 0 ? rgb[(int(body) - 1) % 8 + 1] : 0x555555, \
  mixed(c, 65536, strength) + mixed(c, 256, strength) + mixed(c, 1, strength))
fade(t, end) = 0.22 + 0.4*t/end
# Parts of the plot command for blocks of the data file: bodies by colour, before and at the end; the areas of bodies of
# colour c, 0: of the ground; symbols.
block(k, strength, look) = sprintf(", %s index %d using 1:2:%s with %s%s notitle", file, k, \
  by_time ? '3' : '(shade($4, '.strength.'))', look, by_time ? ' lc palette' : ' lc rgb variable')
before(k, look) = block(k, 'fade($3, '.span.')', look)
now(k, look) = block(k, '1', look)
area(c) = sprintf(", %s index 4 using (($4 > 0 ? (int($4) - 1) %% 8 + 1 : 0) == %d ? $1 : NaN):2 ", file, c + 0). \
  sprintf("with filledcurves closed fc rgb '%s' fs transparent solid 0.25 noborder notitle", c > 0 ? colour(c + 0) : '#999999')
symbols(k, look) = sprintf(", %s index %d using 1:2 with %s notitle", file, k, look)
array images[2] = ['', '']
do for [i = 1:panels] {
  file = i == 1 ? "'mechanism.dat'" : "'mechanism-closeup.dat'"
  span = i == 1 ? 't_end' : 't_closeup'
  images[i] = before(0, 'lines lw 0.7 dt 1').before(3, 'lines lw 0.5 dt 1').before(1, 'lines lw 1.6 dt 1'). \
    before(2, 'points pt 7 ps 0.5')
  do for [k in markers] {
    images[i] = images[i].", 'wheels.dat' index ".k." using 2:3 with lines lw 0.9 dt 1 lc rgb 'black' notitle"
  }
  if (!by_time) { do for [c in areas] { images[i] = images[i].area(c) } }
  images[i] = images[i].now(4, 'lines lw 1.6 dt 1').now(6, 'points pt 7 ps 0.8'). \
    symbols(8, "lines lw 0.7 dt 1 lc rgb '#202020'"). \
    symbols(9, "filledcurves closed fc rgb 'white' fs solid noborder").symbols(9, "lines lw 0.7 dt 1 lc rgb '#202020'")
}
names = ''
do for [i = 1:by_time ? 0 : bodies] {
  names = names.sprintf(", keyentry with lines lw 2 dt 1 lc rgb colour(%d) title short(body[%d])", i, i)
}
do for [form in forms] {
  eval page(form)
  eval axes
  if (by_time) { set cblabel 't [s]' } else { unset colorbox }
  do for [i = 1:panels] {
    if (i == 1 && strlen(names)) { eval key(legend_top, per_row) } else { unset key }
    eval place(i)
    set cbrange [0:i == 1 ? t_end : t_closeup]
    if (by_time) { eval sprintf('set colorbox horizontal user origin graph 0,screen %.6f size graph 1,screen %.6f', \
                                1 - (py1[i] + 38)/height, 6.0/height) }
    eval 'plot '.(i == 1 && strlen(names) ? names[3:*].', '.below.images[i][3:*] : below.images[i][3:*])
  }
  eval finish
}
