/* Relation of the limits of u. Included after block.h. */

#ifndef LIMITS_H
#define LIMITS_H

static const char *limits_in_order(const Model *m) { return m->u_min <= m->u_max ? NULL : "u_min <= u_max"; }

#endif
