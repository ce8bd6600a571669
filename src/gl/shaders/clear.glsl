// Depth is cleared to 1, or to 0 where nearer is larger; what is moved back past that, or lies there, is still to be before it.
float within_clear(float window) {
    return clamp(window, 1e-30, 0.99999994);
}
