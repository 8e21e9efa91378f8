! @run 0.5
! @value moves 31
! @value fact 720
MODULE Recursion
    VAR num moves := 0;
    VAR num fact;
    PROC main()
        hanoi 5, "A", "B", "C";
        fact := factorial(6);
        Stop;
    ENDPROC
    PROC hanoi(num n, string a, string b, string c)
        IF n = 0 RETURN;
        hanoi n - 1, a, c, b;
        Incr moves;
        hanoi n - 1, c, b, a;
    ENDPROC
    FUNC num factorial(num n)
        IF n <= 1 RETURN 1;
        RETURN n * factorial(n - 1);
    ENDFUNC
ENDMODULE
