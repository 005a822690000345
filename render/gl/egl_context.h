#pragma once

#include <string>

namespace strata {

/// Whether EGL knows a device other than Mesa's software GL, or cannot tell: whether it is worth while to start a context.
/// cost  a few ms; starts no driver
bool may_have_gpu();

/// An OpenGL 4.5 core context without a window, current on the thread that made it while it lives.
/// A hardware device is preferred to Mesa's software GL, which then runs on at most `threads` threads.
/// throws  Error{device}, one line that names the step that failed on each platform that was tried
class EglContext {
public:
    explicit EglContext(int threads);
    EglContext(const EglContext&) = delete;
    EglContext& operator=(const EglContext&) = delete;
    ~EglContext();

    const std::string& renderer() const { return renderer_; }  // GL_RENDERER
    bool is_software() const;

private:
    void* display_ = nullptr;
    void* context_ = nullptr;
    std::string renderer_;
};

}  // namespace strata
