/* Constants of a controller exported by fpid_pin $version. Generated. */
#include <math.h>

#include "fpid.h"

#define R(x) ((real_t)(x))

$constants