/* The conclusion of a comparison. */
#ifndef PW_CONCLUSION_H
#define PW_CONCLUSION_H

#include "reference.h"

/* Prints the processor time of each method for 3, 6 and 9 correct digits against a known reference, and failures.  `column` of
 * the rows is the largest error of lengths; that of angles follows. */
void pw_conclusion_print (const pw_study *s, const pw_reference *t, int column);

#endif
