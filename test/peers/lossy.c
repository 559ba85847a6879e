/* A share of the datagrams that a process sends is lost: LD_PRELOAD, and LATTICE_TEST_LOSS_PERCENT. At its end the process
   writes "LOSSY sent lost" to the file LATTICE_TEST_LOSS_FILE, in append mode. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static atomic_ulong state = 1, sent, lost;

static int drops (int fd)
{
  int type = 0;
  socklen_t length = sizeof (type);
  const char *percent = getenv ("LATTICE_TEST_LOSS_PERCENT");
  if (percent == NULL || getsockopt (fd, SOL_SOCKET, SO_TYPE, &type, &length) != 0 || type != SOCK_DGRAM)
    return 0;
  atomic_fetch_add (&sent, 1);
  /* splitmix64 of a counter: no lock, and each datagram its own number. */
  unsigned long z = atomic_fetch_add (&state, 1) * 0x9e3779b97f4a7c15ul + (unsigned long) getpid () * 0x2545f4914f6cdd1dul;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ul;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebul;
  if ((z ^ (z >> 31)) % 1000 >= (unsigned long) atoi (percent) * 10)
    return 0;
  atomic_fetch_add (&lost, 1);
  return 1;
}

ssize_t sendmsg (int fd, const struct msghdr *message, int flags)
{
  static ssize_t (*next) (int, const struct msghdr *, int);
  if (next == NULL)
    next = (ssize_t (*) (int, const struct msghdr *, int)) dlsym (RTLD_NEXT, "sendmsg");
  if (!drops (fd))
    return next (fd, message, flags);
  ssize_t all = 0;
  for (size_t i = 0; i < message->msg_iovlen; i++)
    all += (ssize_t) message->msg_iov[i].iov_len;
  return all;
}

ssize_t sendto (int fd, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
  static ssize_t (*next) (int, const void *, size_t, int, const struct sockaddr *, socklen_t);
  if (next == NULL)
    next = (ssize_t (*) (int, const void *, size_t, int, const struct sockaddr *, socklen_t)) dlsym (RTLD_NEXT, "sendto");
  return drops (fd) ? (ssize_t) size : next (fd, data, size, flags, to, length);
}

__attribute__ ((destructor)) static void report (void)
{
  const char *path = getenv ("LATTICE_TEST_LOSS_FILE");
  FILE *file = path != NULL && sent > 0 ? fopen (path, "a") : NULL;
  if (file == NULL)
    return;
  fprintf (file, "LOSSY %lu %lu\n", sent, lost);
  fclose (file);
}
