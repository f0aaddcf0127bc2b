/* header_alone.c: what follows a public header that is compiled alone; C forbids a file without a
 * declaration. */
typedef int header_alone;
