/* Compares specialised runs of a model with those of the general engine, for tests of --specialise. */
#ifndef SPECIALISE_AGREE_H
#define SPECIALISE_AGREE_H

/* By ten methods. */
void specialise_agree (const char *model);

#endif
