! @run 0.3
! @line a=1
! @line a=1 b=2
! @line a=1 b=2 fast
! @line a=1 slow
! @line through: a=7 b=9
MODULE Optional
    PROC main()
        show 1;
        show 1 \b:=2;
        show 1 \b:=2 \fast;
        show 1 \slow;
        through 7 \b:=9;
        Stop;
    ENDPROC
    PROC through(num a \num b \switch fast | switch slow)
        show a \b?b \fast?fast \slow?slow \prefix:="through: ";
    ENDPROC
    PROC show(num a \num b \switch fast | switch slow \string prefix)
        VAR string text := "";
        IF Present(prefix) text := prefix;
        text := text + "a=" + ValToStr(a);
        IF Present(b) text := text + " b=" + ValToStr(b);
        IF Present(fast) text := text + " fast";
        IF Present(slow) text := text + " slow";
        TPWrite text;
    ENDPROC
ENDMODULE
