/* What the example needs of the machine that it runs on. */
#ifndef PORT_H
#define PORT_H

/* Prints a text. */
void port_print(const char *text);

#endif
