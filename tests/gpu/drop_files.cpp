// drop_files WINDOW FILE...: drops files on an X window, as a file manager would (the XDND protocol, version 5).
#include <X11/Xatom.h>
#include <X11/Xlib.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

struct Drag {
    Display* display = nullptr;
    Window own = 0, target = 0;
    Atom atom(const char* name) const { return XInternAtom(display, name, False); }
    void send(const char* type, long a, long b, long c, long d) const {
        XEvent event{};
        event.xclient.type = ClientMessage;
        event.xclient.window = target;
        event.xclient.message_type = atom(type);
        event.xclient.format = 32;
        event.xclient.data.l[0] = static_cast<long>(own);
        event.xclient.data.l[1] = a;
        event.xclient.data.l[2] = b;
        event.xclient.data.l[3] = c;
        event.xclient.data.l[4] = d;
        XSendEvent(display, target, False, NoEventMask, &event);
        XFlush(display);
    }
    /// The list of files, for whoever asks for the selection.
    void answer(const XSelectionRequestEvent& request, const std::string& uris) const {
        XChangeProperty(display, request.requestor, request.property, request.target, 8, PropModeReplace,
                        reinterpret_cast<const unsigned char*>(uris.data()), static_cast<int>(uris.size()));
        XEvent event{};
        event.xselection.type = SelectionNotify;
        event.xselection.requestor = request.requestor;
        event.xselection.selection = request.selection;
        event.xselection.target = request.target;
        event.xselection.property = request.property;
        event.xselection.time = request.time;
        XSendEvent(display, request.requestor, False, NoEventMask, &event);
        XFlush(display);
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    alarm(20);
    Drag drag;
    drag.display = XOpenDisplay(nullptr);
    if (!drag.display) return 5;
    drag.own = XCreateSimpleWindow(drag.display, DefaultRootWindow(drag.display), 0, 0, 1, 1, 0, 0, 0);
    drag.target = static_cast<Window>(std::strtoul(argv[1], nullptr, 0));
    std::string uris;
    for (int i = 2; i < argc; ++i) uris += std::string("file://") + argv[i] + "\r\n";
    XSetSelectionOwner(drag.display, drag.atom("XdndSelection"), drag.own, CurrentTime);
    const auto list = static_cast<long>(drag.atom("text/uri-list")),
               copy = static_cast<long>(drag.atom("XdndActionCopy"));
    drag.send("XdndEnter", 5L << 24, list, 0, 0);
    drag.send("XdndPosition", 0, 60L << 16 | 60, CurrentTime, copy);
    for (;;) {
        XEvent event;
        XNextEvent(drag.display, &event);
        if (event.type == SelectionRequest) drag.answer(event.xselectionrequest, uris);
        if (event.type != ClientMessage) continue;
        if (event.xclient.message_type == drag.atom("XdndStatus")) {
            if ((event.xclient.data.l[1] & 1) == 0) return 1;  // refused
            drag.send("XdndDrop", 0, CurrentTime, 0, 0);
        }
        if (event.xclient.message_type == drag.atom("XdndFinished")) break;
    }
    XCloseDisplay(drag.display);
    return 0;
}
