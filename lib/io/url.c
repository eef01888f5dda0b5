#include <ebpo/http.h>

#include <string.h>
#include <strings.h>

bool ebpo_is_url(const char *name)
{
    return strncasecmp(name, "http://", 7) == 0 || strncasecmp(name, "https://", 8) == 0;
}

static size_t append(char *out, size_t used, size_t capacity, const char *text, size_t length)
{
    size_t left = capacity - 1 - used, taken = length < left ? length : left;
    memcpy(out + used, text, taken);
    return used + taken;
}

char *ebpo_url_redact(const char *name, char *out, size_t capacity)
{
    size_t used = 0;
    if (capacity == 0)
        return out;
    if (ebpo_is_url(name)) {
        const char *host = strstr(name, "//") + 2;
        used = append(out, 0, capacity, name, (size_t)(host - name));
        for (size_t i = strcspn(host, "/?#"); i > 0; i--)
            if (host[i - 1] == '@') { /* the last one: a password with another breaks the rules, but
                                         is a password */
                host += i;
                break;
            }
        used = append(out, used, capacity, host, strcspn(host, "?#"));
    } else {
        used = append(out, 0, capacity, name, strlen(name));
    }
    out[used] = 0;
    return out;
}
