#pragma once

#include <string>

namespace strata {

/// Whether EGL knows a device other than Mesa's software GL, or cannot tell: whether it is worth while to start a context.
/// cost  a few ms; starts no driver
bool may_have_gpu();

/// An OpenGL 4.5 core context without a window, current on the thread that made it until another one is.
/// A hardware device is preferred to Mesa's software GL, which then runs on at most `threads` threads.
/// throws  Error{device}, one line that names the step that failed on each platform that was tried
class EglContext {
public:
    explicit EglContext(int threads);
    EglContext(const EglContext&) = delete;
    EglContext& operator=(const EglContext&) = delete;
    ~EglContext();

    /// Whoever uses what was made in this context, or destroys it, calls this first where there may be other contexts.
    /// throws  Error{device}: it is current on another thread
    void make_current() const;

    const std::string& renderer() const { return renderer_; }  // GL_RENDERER
    bool is_software() const;

private:
    void* display_ = nullptr;
    void* context_ = nullptr;
    std::string renderer_;
};

}  // namespace strata
