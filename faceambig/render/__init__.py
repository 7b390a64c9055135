"""Pictures without a window: overlay.draw a Scene, gl.render_head one head, painter.paint_photo without OpenGL."""
