#include "render/gl/egl_context.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace strata {
namespace {

std::string egl_error(const char* step) {
    char code[16];
    std::snprintf(code, sizeof code, "0x%04x", unsigned(eglGetError()));
    return std::string(step) + " failed with " + code;
}

bool has_word(const char* words, std::string_view word) {
    if (words == nullptr) return false;
    const std::string_view text(words);
    for (size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) {
        const size_t end = at + word.size();
        if ((at == 0 || text[at - 1] == ' ') && (end == text.size() || text[end] == ' ')) return true;
    }
    return false;
}

// A way to get a display: a device, or Mesa's platform without one.
struct Candidate {
    EGLenum platform;
    void* native;
    std::string name;
    bool software = false;  // for certain
};

std::vector<Candidate> candidates() {
    const char* const client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    std::vector<Candidate> found;
    if (has_word(client, "EGL_EXT_platform_device") && has_word(client, "EGL_EXT_device_enumeration")) {
        EGLint count = 0;
        eglQueryDevicesEXT(0, nullptr, &count);
        std::vector<EGLDeviceEXT> devices(size_t(std::max(count, 0)));
        eglQueryDevicesEXT(count, devices.data(), &count);
        const bool told_apart = has_word(client, "EGL_EXT_device_query");
        for (const bool software : {false, true})
            for (size_t i = 0; i < devices.size(); ++i) {
                const char* const extensions = told_apart ? eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS) : nullptr;
                if (has_word(extensions, "EGL_MESA_device_software") == software)
                    found.push_back({EGL_PLATFORM_DEVICE_EXT, devices[i], "device " + std::to_string(i), software});
            }
    }
    if (has_word(client, "EGL_MESA_platform_surfaceless"))
        found.push_back({EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, "surfaceless"});
    return found;
}

// Empty when the context is current, else what failed.
// A display is never terminated: EGL has one a device, and other contexts of the program may live on it.
std::string start(const Candidate& candidate, void*& display_out, void*& context_out) {
    const EGLDisplay display = eglGetPlatformDisplayEXT(candidate.platform, candidate.native, nullptr);
    if (display == EGL_NO_DISPLAY) return egl_error("eglGetPlatformDisplay");
    if (!eglInitialize(display, nullptr, nullptr)) return egl_error("eglInitialize");
    const char* const extensions = eglQueryString(display, EGL_EXTENSIONS);
    if (!has_word(extensions, "EGL_KHR_no_config_context") || !has_word(extensions, "EGL_KHR_surfaceless_context"))
        return "contexts without a surface are not supported";
    if (!eglBindAPI(EGL_OPENGL_API)) return egl_error("eglBindAPI for OpenGL");
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5,
                                 EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
    if (context == EGL_NO_CONTEXT) return egl_error("eglCreateContext for OpenGL 4.5 core");
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context)) {
        const std::string what = egl_error("eglMakeCurrent");
        eglDestroyContext(display, context);
        return what;
    }
    display_out = display;
    context_out = context;
    return {};
}

}  // namespace

bool may_have_gpu() {
    const std::vector<Candidate> found = candidates();
    // The platform without a surface takes whatever driver there is: where devices are listed it adds none to them.
    const bool listed = std::any_of(found.begin(), found.end(), [](const Candidate& c) { return c.platform == EGL_PLATFORM_DEVICE_EXT; });
    return std::any_of(found.begin(), found.end(), [&](const Candidate& candidate) {
        return !candidate.software && (candidate.platform == EGL_PLATFORM_DEVICE_EXT || !listed);
    });
}

bool EglContext::is_software() const {
    for (const std::string_view name : {"llvmpipe", "softpipe", "swrast", "SWR"})
        if (renderer_.find(name) != std::string::npos) return true;
    return false;
}

EglContext::EglContext(int threads) {
    // Read once by Mesa's software GL when its first context is made; 0 draws on the calling thread.
    setenv("LP_NUM_THREADS", std::to_string(threads > 1 ? threads : 0).c_str(), 0);
    std::string failures;
    for (const Candidate& candidate : candidates()) {
        const std::string failure = start(candidate, display_, context_);
        if (failure.empty()) {
            const char* const name = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
            renderer_ = name != nullptr ? name : "";
            return;
        }
        failures += (failures.empty() ? "" : "; ") + candidate.name + ": " + failure;
    }
    if (failures.empty()) failures = "EGL offers neither devices nor the surfaceless platform";
    throw Error(ErrorKind::device, "no OpenGL 4.5 without a window: " + failures);
}

EglContext::~EglContext() {
    if (eglGetCurrentContext() == context_) eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
}

void EglContext::make_current() const {
    if (eglGetCurrentContext() == context_) return;
    if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) throw Error(ErrorKind::device, egl_error("eglMakeCurrent"));
}

}  // namespace strata
