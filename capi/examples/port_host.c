/* The example's machine is a host with a C library. */
#include <stdio.h>

#include "port.h"

void port_print(const char *text)
{
    fputs(text, stdout);
}
