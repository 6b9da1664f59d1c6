/* Preloaded into a program: ends it with SIGKILL before (KILL_WHEN=before) or after its KILL_AT-th rename. RENAMES names a file that gets
   a byte for each rename. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int rename(const char *from, const char *to) {
  static int count;
  int (*real)(const char *, const char *) = (int (*)(const char *, const char *))dlsym(RTLD_NEXT, "rename");
  const char *at = getenv("KILL_AT"), *when = getenv("KILL_WHEN");
  int now = at && ++count == atoi(at);
  if (now && when && !strcmp(when, "before")) kill(getpid(), SIGKILL);
  int result = real(from, to);
  const char *counted = getenv("RENAMES");
  int file = counted ? open(counted, O_WRONLY | O_CREAT | O_APPEND, 0644) : -1;
  if (file >= 0 && write(file, ".", 1) < 0) abort();
  if (file >= 0) close(file);
  if (now) kill(getpid(), SIGKILL);
  return result;
}
