#pragma once

#include <string>

namespace strata {

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

private:
    void* display_ = nullptr;
    void* context_ = nullptr;
    std::string renderer_;
};

}  // namespace strata
